#include "profile_sum.h"

#include "negligible_time.h"

namespace stepdriver::motion {

void ProfileSum::begin(std::int64_t start_ns) {
  size_ = terms_ = 0;
  start_ns_ = start_ns;
  piece_start_ = piece_end_ = {};
}

void ProfileSum::add(double factor, const ShapedProfile& motion) {
  const Profile& profile = motion.profile();
  if (motion.shaper() == nullptr) {
    addPart(factor, profile, profile.startNs());
  } else {
    for (const Impulse& impulse : motion.shaper()->impulses()) {
      addPart(exactProduct(factor, impulse.part), profile, profile.startNs() + impulse.delay_ns);
    }
  }
  ++terms_;
}

void ProfileSum::addPart(DoubleDouble factor, const Profile& profile, std::int64_t start_ns) {
  Part& part = parts_[size_++];
  part = {terms_, factor, &profile, profile.endPosition(), secondsOf(start_ns_ - start_ns), 0};
  if (profile.pieceCount() == 0) {
    part.profile = nullptr;
  } else if (part.since.hi > 0.0) {
    part.piece = profile.pieceAt(part.since);
  }
}

void ProfileSum::add(double factor, DoubleDouble position) {
  parts_[size_++] = {terms_++, factor, nullptr, position, {}, 0};
}

void ProfileSum::rest(std::size_t term) {
  for (std::size_t i = 0; i < size_; ++i) {
    if (parts_[i].term == term) parts_[i].profile = nullptr;
  }
}

DoubleDouble ProfileSum::addPiece(Part& part, DoubleDouble from) {
  const auto rests = [&](DoubleDouble position) { piece_.p0 = piece_.p0 + part.factor * position; };
  if (part.profile == nullptr) {
    rests(part.position);
    return from;
  }
  const Profile& profile = *part.profile;
  const DoubleDouble at = from + part.since;
  if (at.hi < -kNegligibleTime) {
    rests(profile.startPosition());
    return -part.since;
  }
  const std::size_t count = profile.pieceCount();
  while (part.piece < count && !((profile.pieceStart(part.piece + 1) - at).hi > kNegligibleTime)) {
    ++part.piece;
  }
  if (part.piece == count) {
    rests(part.position);
    return from;
  }
  const Piece piece = profile.piece(part.piece);
  DoubleDouble t = at - profile.pieceStart(part.piece);
  if (t.hi < 0.0) t = {};
  piece_.p0 = piece_.p0 + part.factor * piece.positionAt(t);
  velocity_ = velocity_ + part.factor * piece.velocityAt(t);
  acceleration_ = acceleration_ + part.factor * piece.accelerationAt(t);
  piece_.j += part.factor.value() * piece.j;
  return profile.pieceStart(part.piece + 1) - part.since;
}

bool ProfileSum::next() {
  piece_start_ = piece_end_;
  piece_ = {};
  velocity_ = acceleration_ = {};
  bool moves = false;
  for (std::size_t i = 0; i < size_; ++i) {
    const DoubleDouble end = addPiece(parts_[i], piece_start_);
    if (!(piece_start_ < end)) continue;
    if (!moves || end < piece_end_) piece_end_ = end;
    moves = true;
  }
  if (!moves) return false;
  piece_.duration = piece_end_ - piece_start_;
  piece_.v0 = velocity_.hi;
  piece_.v0_rest = velocity_.lo;
  piece_.a = acceleration_.hi;
  piece_.a_rest = acceleration_.lo;
  return true;
}

}  // namespace stepdriver::motion
