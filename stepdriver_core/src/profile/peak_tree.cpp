#include "peak_tree.h"

#include <algorithm>
#include <cmath>

#include "profile_parts.h"

namespace stepdriver::motion {
namespace {

constexpr double kTimeRounding = 1e-12;  // [s] because times are sums of doubles

}  // namespace

Highest larger(const Highest& a, const Highest& b) {
  return {std::max(a.speed, b.speed), std::max(a.acceleration, b.acceleration),
          std::max(a.jerk, b.jerk)};
}

Highest highestOf(const Piece& piece) {
  const double end = piece.duration.value();
  double speed = std::max(std::abs(piece.v0), std::abs(piece.velocityAt(piece.duration).value()));
  const double level = piece.j != 0.0 ? -piece.a / piece.j : 0.0;
  if (level > 0.0 && level < end)
    speed = std::max(speed, std::abs(piece.velocityAt(level).value()));
  return {speed, std::max(std::abs(piece.a), std::abs(piece.a + piece.j * end)), std::abs(piece.j)};
}

PeakTree::PeakTree(const Profile& profile)
    : profile_(profile), leaves_(profile.pieces().size()), nodes_(2 * leaves_) {
  for (std::size_t i = 0; i < leaves_; ++i) nodes_[leaves_ + i] = highestOf(profile.pieces()[i]);
  for (std::size_t i = leaves_; i-- > 1;) nodes_[i] = larger(nodes_[2 * i], nodes_[2 * i + 1]);
}

Highest PeakTree::between(DoubleDouble from, DoubleDouble to) const {
  if (leaves_ == 0 || !(from < profile_.duration())) return {};
  // A piece that is only a rounding error is ignored.
  std::size_t first = profile_.pieceAt(from);
  std::size_t last = profile_.pieceAt(to);
  if (first < last && !((profile_.pieceStart(first + 1) - from).hi > kTimeRounding)) ++first;
  if (first < last && !((to - profile_.pieceStart(last)).hi > kTimeRounding)) --last;
  const auto of_part = [&](std::size_t index) {
    const DoubleDouble begin = std::max(from, profile_.pieceStart(index));
    const DoubleDouble end = std::min(to, profile_.pieceStart(index + 1));
    const DoubleDouble after = begin - profile_.pieceStart(index);
    return highestOf(partOf(profile_.pieces()[index], after, end - begin));
  };
  const Highest ends = larger(of_part(first), of_part(last));
  return first + 1 < last ? larger(ends, ofPieces(first + 1, last)) : ends;
}

// From the leaves upwards: at each level, nodes that don't make up a whole parent are taken
// individually.
Highest PeakTree::ofPieces(std::size_t begin, std::size_t end) const {
  Highest highest;
  for (begin += leaves_, end += leaves_; begin < end; begin /= 2, end /= 2) {
    if (begin % 2 == 1) highest = larger(highest, nodes_[begin++]);
    if (end % 2 == 1) highest = larger(highest, nodes_[--end]);
  }
  return highest;
}

}  // namespace stepdriver::motion
