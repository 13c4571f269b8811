#pragma once

#include <optional>

namespace stepdriver::joystick {

/// What is to be sent for one axis now; what isn't set isn't sent.
struct JogOrders {
  std::optional<double> velocity;  ///< [m/s|rad/s] to jog at
  std::optional<bool> enable;      ///< to call the axis's service `enable` with
};

/// Decides what an axis is sent while its stick is out and in the dead band. It knows no clock:
/// times are seconds on any that never goes back.
class JogSequence {
 public:
  JogSequence() = default;
  /// An axis that is disabled in the dead band, and enabled before it jogs. Until it has jogged
  /// for the first time, nothing of it is changed.
  ///
  /// @param disable_after [s] how long it stays enabled in the dead band.
  static JogSequence disabling(double disable_after);

  /// What to send. To be called regularly: it repeats the velocity while the stick is out, and
  /// gives 0 once when it is back. After an order to enable it gives none before answered().
  ///
  /// @param velocity what the stick asks for; 0: the dead band.
  JogOrders orders(double velocity, double now);

  /// The service has answered, or there was nobody to answer.
  void answered(bool success, double now);

 private:
  enum class Power { kOff, kEnabling, kOn, kDisabling };

  JogOrders ordersWhileOn(double velocity, double now);

  std::optional<double> disable_after_;  ///< none: the axis's power is nobody's concern here
  Power power_ = Power::kOn;
  bool jogging_ = false;
  double in_dead_band_since_ = 0.0;
  double not_before_ = 0.0;  ///< after an order that failed
};

}  // namespace stepdriver::joystick
