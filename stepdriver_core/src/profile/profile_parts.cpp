#include "profile_parts.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "give_way.h"
#include "negligible_time.h"

namespace stepdriver::motion {
namespace {

// Goes through a profile, from a time after its start on.
class Walk {
 public:
  explicit Walk(const Profile& profile, DoubleDouble from = {}) : profile_(profile), time_(from) {
    const std::size_t count = profile.pieces().size();
    index_ = count > 0 ? profile.pieceAt(from) : 0;
    while (index_ < count && !(left().hi > kNegligibleTime)) ++index_;
  }

  /// Whether the motion continues.
  bool moves() const { return index_ < profile_.pieces().size(); }
  /// [s] How long the current piece still lasts. @pre moves()
  DoubleDouble left() const { return profile_.pieceStart(index_ + 1) - time_; }

  /// The next part of the current polynomial, which lasts this long.
  Piece advance(DoubleDouble duration) {
    if (!moves()) return {duration, profile_.endPosition()};
    const DoubleDouble t = time_ - profile_.pieceStart(index_);
    const Piece taken = partOf(profile_.pieces()[index_], t, duration);
    const bool whole = !((left() - duration).hi > kNegligibleTime);
    time_ = whole ? profile_.pieceStart(index_ + 1) : time_ + duration;
    if (whole) ++index_;
    return taken;
  }

 private:
  const Profile& profile_;
  std::size_t index_ = 0;
  DoubleDouble time_;
};

Piece sumOf(const Piece& a, const Piece& b) {
  const DoubleDouble v = DoubleDouble(a.v0, a.v0_rest) + DoubleDouble(b.v0, b.v0_rest);
  const DoubleDouble acceleration = DoubleDouble(a.a, a.a_rest) + DoubleDouble(b.a, b.a_rest);
  return {a.duration, a.p0 + b.p0, v.hi, acceleration.hi, a.j + b.j, v.lo, acceleration.lo};
}

}  // namespace

Piece partOf(const Piece& piece, DoubleDouble from, DoubleDouble duration) {
  const DoubleDouble v = piece.velocityAt(from);
  const DoubleDouble a = piece.accelerationAt(from);
  return {duration, piece.positionAt(from), v.hi, a.hi, piece.j, v.lo, a.lo};
}

Profile part(const Profile& profile, DoubleDouble from, DoubleDouble to) {
  Walk walk(profile, from);
  std::vector<Piece> pieces;
  DoubleDouble time = from;
  while ((to - time).hi > kNegligibleTime) {
    const DoubleDouble left = to - time;
    const DoubleDouble duration = walk.moves() ? std::min(walk.left(), left) : left;
    pieces.push_back(walk.advance(duration));
    time = time + duration;
  }
  if (pieces.empty()) return {profile.startNs(), profile.startPosition()};
  return {profile.startNs(), std::move(pieces)};
}

Profile sum(const Profile& a, const Profile& b) {
  Walk of_a(a);
  Walk of_b(b);
  std::vector<Piece> pieces;
  while (of_a.moves() || of_b.moves()) {
    const DoubleDouble duration = !of_b.moves()   ? of_a.left()
                                  : !of_a.moves() ? of_b.left()
                                                  : std::min(of_a.left(), of_b.left());
    giveWayAt(pieces.size());
    pieces.push_back(sumOf(of_a.advance(duration), of_b.advance(duration)));
  }
  if (pieces.empty()) return {a.startNs(), a.endPosition() + b.endPosition()};
  return {a.startNs(), std::move(pieces)};
}

}  // namespace stepdriver::motion
