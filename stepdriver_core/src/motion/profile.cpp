#include "stepdriver_core/motion/profile.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace stepdriver::motion {

DoubleDouble Piece::positionAt(DoubleDouble t) const {
  // Horner, without the terms that are not there: most pieces have no jerk, many no acceleration.
  DoubleDouble slope = v0;
  if (a != 0.0) slope = slope + t * DoubleDouble(a / 2.0);
  if (j != 0.0) slope = slope + t * t * DoubleDouble(j) / DoubleDouble(6.0);
  return p0 + t * slope;
}

DoubleDouble Piece::velocityAt(DoubleDouble t) const {
  return DoubleDouble(v0) + t * (DoubleDouble(a) + t * DoubleDouble(j / 2.0));
}

Profile::Profile(std::int64_t start_ns, DoubleDouble position)
    : start_ns_(start_ns),
      end_ns_(start_ns),
      start_position_(position),
      end_position_(position),
      starts_(1) {}

Profile::Profile(std::int64_t start_ns, std::vector<Piece> pieces)
    : start_ns_(start_ns), pieces_(std::move(pieces)) {
  DoubleDouble time;
  starts_.reserve(pieces_.size() + 1);
  starts_.push_back(time);
  for (const Piece& piece : pieces_) {
    time = time + piece.duration;
    starts_.push_back(time);
  }
  if (!(time.hi < kLongest)) throw std::range_error("the motion takes longer than a hundred years");
  end_ns_ = start_ns_ + splitNanoseconds(time).whole;
  start_position_ = pieces_.front().p0;
  end_position_ = pieces_.back().positionAt(pieces_.back().duration);
}

double Profile::peakSpeed() const {
  double peak = 0.0;
  for (const Piece& piece : pieces_) {
    peak = std::max({peak, std::abs(piece.v0), std::abs(piece.velocityAt(piece.duration).value())});
  }
  return peak;
}

MotionState Profile::stateAt(std::int64_t time_ns) const {
  if (time_ns <= start_ns_ || pieces_.empty()) {
    const double v0 = time_ns == start_ns_ && !pieces_.empty() ? pieces_.front().v0 : 0.0;
    return {start_position_, v0, 0.0};
  }
  if (time_ns >= end_ns_) return {end_position_, 0.0, 0.0};
  const DoubleDouble since = fromInteger(time_ns - start_ns_) / DoubleDouble(1e9);
  const auto later = std::upper_bound(starts_.begin() + 1, starts_.end() - 1, since);
  const std::size_t index = static_cast<std::size_t>(later - starts_.begin()) - 1;
  const Piece& piece = pieces_[index];
  const DoubleDouble t = since - starts_[index];
  return {piece.positionAt(t), piece.velocityAt(t).value(), piece.a + piece.j * t.value()};
}

}  // namespace stepdriver::motion
