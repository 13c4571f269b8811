#pragma once

#include <optional>
#include <string>

namespace stepdriver::console {

/// The jog of one axis by a key that is held. A terminal tells of no key that is let go: it only
/// repeats one that is held. So a key jogs for a short while, each repeat prolongs that, and the
/// jog ends by itself when none comes. It knows no clock: times are seconds on any that never goes
/// back.
class HeldJog {
 public:
  /// [s] after a key, or its last repeat: longer than from one repeat to the next, and short
  /// against a hand that lets go. A terminal's first repeat comes later: the axis comes to rest
  /// once before it goes on.
  static constexpr double kHold = 0.2;

  struct Order {
    std::string axis;
    double velocity = 0.0;  ///< [mm/s|deg/s] 0 ends the jog
  };

  /// @param period [s] from one order to the next while the jog goes on.
  void setPeriod(double period) { period_ = period; }

  /// A key, or one of its repeats. Another axis than the one before: end() comes first.
  void press(const std::string& axis, double velocity, double now);
  /// What the driver is to be told now. To be called often.
  std::optional<Order> due(double now);
  /// Ends the jog. @return what the driver is to be told, where one was under way.
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
