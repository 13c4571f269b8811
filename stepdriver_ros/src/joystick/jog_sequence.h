#pragma once

#include <optional>

namespace stepdriver::joystick {

/// What to send for one axis now; empty members are not sent.
struct JogOrders {
  std::optional<double> velocity;  ///< [m/s|rad/s] the velocity of the jog
  std::optional<bool> enable;      ///< argument for the axis's service `enable`
};

/// Decides what to send for an axis while its stick is deflected and in the dead band. It has no
/// clock: times are seconds on any clock that never goes back.
class JogSequence {
 public:
  JogSequence() = default;
  /// For an axis that is disabled in the dead band, and enabled before it jogs. Nothing changes
  /// before the first jog.
  ///
  /// @param disable_after [s] how long it stays enabled in the dead band.
  static JogSequence disabling(double disable_after);

  /// What to send. Call it regularly: it repeats the velocity while the stick is deflected, and
  /// returns 0 once when the stick is back. After an order to enable, it returns no velocity until
  /// answered().
  ///
  /// @param velocity requested by the stick; 0: the dead band.
  JogOrders orders(double velocity, double now);

  /// The service has answered, or doesn't exist.
  void answered(bool success, double now);

 private:
  enum class Power { kOff, kEnabling, kOn, kDisabling };

  JogOrders ordersWhileOn(double velocity, double now);

  std::optional<double> disable_after_;  ///< empty: the axis is never disabled here
  Power power_ = Power::kOn;
  bool jogging_ = false;
  double in_dead_band_since_ = 0.0;
  double not_before_ = 0.0;  ///< after a failed order
};

}  // namespace stepdriver::joystick
