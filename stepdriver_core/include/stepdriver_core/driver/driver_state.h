#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace stepdriver::driver {

/// What a driver chip has told of itself over its UART or SPI.
///
/// @code{.cpp}
/// const axis::AxisState x = machine.axis("x").state();
/// if (x.drivers == nullptr) return;  // none has registers that are known
/// for (const driver::DriverState& chip : *x.drivers) std::cout << chip.run_current << " A\n";
/// @endcode
struct DriverState {
  std::string motor;       ///< of an axis with several; empty: it is the only one
  bool is_set_up = false;  ///< its registers are written and verified
  /// [A rms] As set, in motion and at rest: the step of the chip's scale below what is wanted.
  double run_current = 0.0;
  double hold_current = 0.0;
  /// [A rms] At this moment, on the way from one to the other.
  double present_current = 0.0;
  bool stealth_chop = false;  ///< it chops silently at this moment
  int at_least_celsius = 0;   ///< the highest threshold that its temperature is above; 0: none
  bool temperature_warning = false;  ///< it will soon switch itself off
  bool open_load_a = false;          ///< no current flows in coil A; true at speed or at rest too
  bool open_load_b = false;
  /// SG_RESULT in the last motion, in which a TMC2209 is asked for it twenty times a second: the
  /// lower, the higher the load. It depends on the speed and the current, and means something only
  /// while the chip chops silently. Empty: the chip hasn't measured it.
  std::optional<int> stall_guard;
  double stall_guard_position = 0.0;  ///< [unit] of the axis, as planned, when SG_RESULT was read
  double stall_guard_velocity = 0.0;  ///< [unit/s] the same
  int highest_stall_guard = 510;      ///< without a load
  std::uint64_t transactions = 0;     ///< reads and writes of its registers that succeeded
  std::uint64_t retries = 0;          ///< that were tried again
};

/// How much of its capacity the load takes, from 0 to 1, to be compared at the same speed and
/// current only. Empty: the chip hasn't measured it.
std::optional<double> loadOf(const DriverState& driver);

}  // namespace stepdriver::driver
