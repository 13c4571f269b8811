#pragma once

#include <cstdint>
#include <optional>

namespace stepdriver::motion {

/// The position setpoints of one axis as they arrive: how far apart they come, and how fast the
/// position changes. Times of arrival jitter, so the period and the times are smoothed.
class SetpointStream {
 public:
  /// The estimate after a setpoint has come.
  struct Course {
    std::int64_t came_ns = 0;    ///< motion time at which it came, smoothed
    std::int64_t period_ns = 0;  ///< the stream's period; 0: it is the first setpoint
    double velocity = 0.0;       ///< [microsteps/s] how fast the position changes
  };

  /// @param position [microsteps] @param now motion time
  /// @param timeout_ns A setpoint that comes later than this after the last one begins a stream.
  ///   So does one that comes more than 75 ms after it, because streams have at least 20 Hz.
  /// @param stops AxisModel::stops: a stop ends a stream too.
  Course add(double position, std::int64_t now, std::int64_t timeout_ns, std::uint64_t stops);
  /// Another command has taken the axis: the next setpoint begins a stream.
  void end() { last_.reset(); }

 private:
  struct Last {
    double position = 0.0;
    std::int64_t arrived_ns = 0;
    Course course;
    std::uint64_t stops = 0;
  };

  std::optional<Last> last_;
};

}  // namespace stepdriver::motion
