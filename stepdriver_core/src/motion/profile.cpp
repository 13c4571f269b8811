#include "stepdriver_core/motion/profile.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace stepdriver::motion {

DoubleDouble Piece::positionAt(DoubleDouble t) const {
  // Horner, without the terms that are not there: most pieces have no jerk, many no acceleration.
  DoubleDouble slope(v0, v0_rest);
  if (a != 0.0) slope = slope + t * DoubleDouble(a / 2.0, a_rest / 2.0);
  if (j != 0.0) slope = slope + t * t * DoubleDouble(j) / DoubleDouble(6.0);
  return p0 + t * slope;
}

DoubleDouble Piece::velocityAt(DoubleDouble t) const {
  return DoubleDouble(v0, v0_rest) + t * (DoubleDouble(a, a_rest) + t * DoubleDouble(j / 2.0));
}

DoubleDouble Piece::accelerationAt(DoubleDouble t) const {
  return DoubleDouble(a, a_rest) + t * DoubleDouble(j);
}

double Piece::firstTurn(double after) const {
  const double end = duration.value();
  const double margin = 1e-9 * end;
  double first = end;
  const auto consider = [&](double root) {
    if (root > after + margin && root < end - margin) first = std::min(first, root);
  };
  if (j == 0.0) {
    if (a != 0.0) consider(-v0 / a);
    return first;
  }
  const double discriminant = a * a - 2.0 * j * v0;
  if (discriminant <= 0.0) return first;  // never, or a touch without a change of sign
  const double q = -(a + std::copysign(std::sqrt(discriminant), a));
  consider(q / j);
  if (q != 0.0) consider(2.0 * v0 / q);
  return first;
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
    const auto speed = [&piece](DoubleDouble t) { return std::abs(piece.velocityAt(t).value()); };
    peak = std::max({peak, std::abs(piece.v0), speed(piece.duration)});
    const double level = piece.j != 0.0 ? -piece.a / piece.j : 0.0;
    if (level > 0.0 && level < piece.duration.hi) peak = std::max(peak, speed(level));
  }
  return peak;
}

MotionState Profile::stateAt(std::int64_t time_ns) const {
  if (time_ns <= start_ns_ || pieces_.empty()) {
    if (time_ns < start_ns_ || pieces_.empty()) return {start_position_, 0.0, 0.0};
    return {start_position_, pieces_.front().v0, pieces_.front().a};
  }
  if (time_ns >= end_ns_) return {end_position_, 0.0, 0.0};
  const DoubleDouble since = fromInteger(time_ns - start_ns_) / DoubleDouble(1e9);
  const auto later = std::upper_bound(starts_.begin() + 1, starts_.end() - 1, since);
  const std::size_t index = static_cast<std::size_t>(later - starts_.begin()) - 1;
  const Piece& piece = pieces_[index];
  const DoubleDouble t = since - starts_[index];
  return {piece.positionAt(t), piece.velocityAt(t).value(), piece.accelerationAt(t).value()};
}

}  // namespace stepdriver::motion
