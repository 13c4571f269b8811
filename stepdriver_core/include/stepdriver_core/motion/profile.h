#pragma once

#include <cstdint>
#include <vector>

#include "stepdriver_core/motion/double_double.h"

namespace stepdriver::motion {

/// A cubic piece of position over time: p0 + v0 t + a t^2/2 + j t^3/6 for t from 0 to duration.
struct Piece {
  DoubleDouble duration;  ///< [s]
  DoubleDouble p0;        ///< [microsteps]
  double v0 = 0.0;        ///< [microsteps/s]
  double a = 0.0;         ///< [microsteps/s^2]
  double j = 0.0;         ///< [microsteps/s^3]
  double v0_rest = 0.0;   ///< what v0 leaves of the exact speed
  double a_rest = 0.0;    ///< what a leaves of the exact acceleration

  /// At t [s] from the beginning of the piece; in the units of p0, v0 and a.
  DoubleDouble positionAt(DoubleDouble t) const;
  DoubleDouble velocityAt(DoubleDouble t) const;
  DoubleDouble accelerationAt(DoubleDouble t) const;

  /// The first time after `after` [s] and clearly before the end at which the velocity changes its
  /// sign; the end where there is none. A turning point this close to an end moves nothing.
  double firstTurn(double after) const;
};

/// Where a motion is at one time.
struct MotionState {
  DoubleDouble position;      ///< [microsteps]
  double velocity = 0.0;      ///< [microsteps/s]
  double acceleration = 0.0;  ///< [microsteps/s^2]
};

/// A motion: pieces in a row from a start time on, at rest before and after. Times are motion time,
/// in nanoseconds. Never changed once made, so any thread may read it.
class Profile {
 public:
  /// No motion: rest at `position`.
  Profile(std::int64_t start_ns, DoubleDouble position);

  /// @param pieces each begins where the one before it ends; at least one.
  /// @throw std::range_error where the motion takes longer than kLongest.
  Profile(std::int64_t start_ns, std::vector<Piece> pieces);

  static constexpr double kLongest = 4.0e9;  ///< [s] a good 126 years; nanoseconds stay in int64

  /// Motion time at which the first piece begins.
  std::int64_t startNs() const { return start_ns_; }
  /// When the motion is over, to the nearest nanosecond; no step is later.
  std::int64_t endNs() const { return end_ns_; }
  DoubleDouble duration() const { return starts_.back(); }  ///< [s]
  /// Where it rests in the end [microsteps].
  DoubleDouble endPosition() const { return end_position_; }
  /// Highest speed on the way [microsteps/s].
  double peakSpeed() const;

  /// At rest before the start and after the end.
  MotionState stateAt(std::int64_t time_ns) const;

  /// In the order of time; none where nothing moves.
  const std::vector<Piece>& pieces() const { return pieces_; }
  /// When a piece begins, counted from the start [s]; one more than there are pieces: the end.
  DoubleDouble pieceStart(std::size_t index) const { return starts_[index]; }

 private:
  std::int64_t start_ns_;
  std::int64_t end_ns_;
  DoubleDouble start_position_;
  DoubleDouble end_position_;
  std::vector<Piece> pieces_;
  std::vector<DoubleDouble> starts_;
};

}  // namespace stepdriver::motion
