#pragma once

#include <optional>
#include <string>

namespace stepdriver::config {

/// How a driver chip chops the current of its coils.
enum class ChopperMode {
  kStealthChop,  ///< silent, for low and medium speeds
  kSpreadCycle,  ///< audible, with more torque at high speeds
};

/// How a driver chip detects a stall of its motor (StallGuard), for a homing to it.
struct StallConfig {
  /// Of a TMC2209 or TMC2226, 0 to 255: SG_RESULT at or below twice this is a stall; higher is more
  /// sensitive. Of a TMC2130 or TMC5160, -64 to 63 (SGT): lower is more sensitive. It depends on
  /// the speed, the current and the motor.
  int threshold = 0;
  double current = 0.0;  ///< [A rms] of a coil, while it approaches
  /// 0 to 1023: MSCNT, the place in the electrical cycle, at which the motor is blocked; empty: not
  /// known. With it the place is found to a microstep, without it to about 4 full steps.
  std::optional<int> phase;
};

/// How a driver chip detects in any motion that its motor has stalled (StallGuard), which is a
/// fault.
struct StallFaultConfig {
  int threshold = 0;   ///< see StallConfig
  double above = 0.0;  ///< [full steps/s] of the motor: below this speed SG_RESULT means nothing
};

/// A driver chip that is configured and diagnosed over its UART or SPI. A program that makes its
/// own config::MotorConfig gives it a driver::registerChip().
///
/// @code{.cpp}
/// config::TmcConfig tmc;
/// tmc.port = "/dev/serial0";
/// tmc.sense_resistor = 0.11;  // [Ohm]
/// tmc.run_current = 0.8;      // [A rms]
/// config::AxisConfig x;
/// x.driver = driver::registerChip(driver::driverChip("tmc2209"));
/// x.tmc = tmc;
/// @endcode
struct TmcConfig {
  /// Serial port, such as `/dev/serial0`, or SPI device, such as `/dev/spidev0.0`.
  std::string port;
  int baud = 115200;            ///< the same for all chips of a port; 0 on SPI
  int address = 0;              ///< MS1 + 2 MS2; 0 on a TMC2208, and on SPI
  double sense_resistor = 0.0;  ///< [Ohm] of the board
  double run_current = 0.0;     ///< [A rms] of a coil, in motion
  double hold_current = 0.0;    ///< [A rms] at rest, hold_delay after the last step
  double hold_delay = 0.5;      ///< [s]
  /// [A rms] at rest after the idle timeout, with kLowerCurrent of IdleAction.
  std::optional<double> idle_current;
  ChopperMode mode = ChopperMode::kStealthChop;
  /// [full steps/s] With kStealthChop: above this speed of the motor it chops as kSpreadCycle does;
  /// 0: at none.
  double spread_cycle_above = 0.0;
  std::optional<StallConfig> stall;
  std::optional<StallFaultConfig> stall_fault;
  bool interpolate = true;  ///< the chip divides each microstep into steps of 1/256
};

}  // namespace stepdriver::config
