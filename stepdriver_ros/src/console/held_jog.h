#pragma once

#include <optional>
#include <string>

namespace stepdriver::console {

/// The jog of one axis while a key is held. A terminal does not report that a key was released; it
/// only repeats a key that is held. A key therefore jogs for a short while, each repeat extends
/// that, and the jog ends by itself without repeats. It has no clock: times are seconds on any
/// clock that never goes back.
class HeldJog {
 public:
  /// [s] after a key or its last repeat: longer than the time between repeats, and short enough
  /// after a key is released. A terminal's first repeat comes later: the axis comes to rest once
  /// before it continues.
  static constexpr double kHold = 0.2;

  struct Order {
    std::string axis;
    double velocity = 0.0;  ///< [mm/s|deg/s] 0 ends the jog
  };

  /// @param period [s] from one order to the next during the jog.
  void setPeriod(double period) { period_ = period; }

  /// A key, or one of its repeats. Call end() before changing the axis.
  void press(const std::string& axis, double velocity, double now);
  /// The order for the driver now. Call it often.
  std::optional<Order> due(double now);
  /// Ends the jog. @return the order for the driver, if there was a jog.
  std::optional<Order> end();

  bool active() const { return !axis_.empty(); }
  const std::string& axis() const { return axis_; }

 private:
  double period_ = 0.04;
  std::string axis_;  ///< empty: no jog
  double velocity_ = 0.0;
  double until_ = 0.0;
  double next_ = 0.0;
};

}  // namespace stepdriver::console
