#pragma once

#include <cstddef>
#include <vector>

namespace stepdriver::motion {

/// A value that counts from one distance to another one [unit].
struct CeilingSpan {
  double from = 0.0;
  double to = 0.0;
  double value = 0.0;
};

/// The lowest of all values at each distance.
class Ceiling {
 public:
  explicit Ceiling(std::vector<CeilingSpan> spans);

  /// @return infinity if there is no span.
  double lowest(double from, double to) const;
  /// The distances at which the value changes, in increasing order.
  const std::vector<double>& places() const { return places_; }

 private:
  std::vector<double> places_;
  std::vector<double> values_;  // the lowest value between each place and the next one
};

/// A place of a motion. Up to the next one the square of the speed is linear in the distance: the
/// acceleration is constant.
struct SpeedPlace {
  double distance = 0.0;  ///< [unit]
  double square = 0.0;    ///< [unit^2/s^2] the square of the speed
};

/// Lowers the speed around each of its maxima that lasts less than `time` to the highest one that
/// then lasts so long, or to the higher one of the two minima around it: then they become one
/// maximum, which is lowered as well.
///
/// @param places The last one is at rest. So is the first one, or the motion has passed the second.
std::vector<SpeedPlace> flattenPeaks(std::vector<SpeedPlace> places, double time);

/// A part of a smoothed motion, with constant jerk.
struct AveragedPart {
  double time = 0.0;          ///< [s] This and what follows are those at its begin.
  double distance = 0.0;      ///< [unit]
  double speed = 0.0;         ///< [unit/s]
  double acceleration = 0.0;  ///< [unit/s^2]
  double jerk = 0.0;          ///< [unit/s^3]
  /// The part of the given motion that is averaged is from `rear` to `front` [unit], and has these
  /// accelerations there in this part of the smoothed motion.
  double rear = 0.0;
  double front = 0.0;
  double rear_acceleration = 0.0;
  double front_acceleration = 0.0;
  /// In the time of the average before its begin, the acceleration of the given motion was constant
  /// apart from small changes.
  bool even = false;
};

/// The moving average of a motion, whose distance at the time t is s0(t):
///
///     s(t) = 1/T integral of s0 from t - T to t
///
/// So the speed and the acceleration are averages of those of s0, and the jerk is
/// (s0''(t) - s0''(t - T))/T. If the speed of s0 is at most c within c T/2 of a place, s' is at
/// most c at that place: let s0 be beyond c T/2 after it at the time t, as otherwise the average is
/// one of speeds up to c. Going back in time from there, s0 falls by c or less per time, for T at
/// least. Its average over T would then be after the place, which it is not.
///
/// @param places The given motion, from rest to rest. If it `moves`, it was at the first place at
///   the time -T, and is at the second one at the time 0, when its average is at the distance 0.
/// @param time T, above 0 [s].
/// @return The parts of the average. The last one is at rest.
std::vector<AveragedPart> movingAverage(const std::vector<SpeedPlace>& places, double time,
                                        bool moves = false);

}  // namespace stepdriver::motion
