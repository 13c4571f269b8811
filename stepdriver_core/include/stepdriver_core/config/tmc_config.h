#pragma once

#include <string>

namespace stepdriver::config {

/// How a driver chip chops the current of its coils.
enum class ChopperMode {
  kStealthChop,  ///< silent, for low and medium speeds
  kSpreadCycle,  ///< audible, with more torque at high speeds
};

/// A driver chip that is configured and diagnosed over its UART. A program that makes its own
/// config::MotorConfig gives it a driver::uartChip().
///
/// @code{.cpp}
/// config::TmcConfig tmc;
/// tmc.port = "/dev/serial0";
/// tmc.sense_resistor = 0.11;  // [Ohm]
/// tmc.run_current = 0.8;      // [A rms]
/// config::AxisConfig x;
/// x.driver = driver::uartChip(driver::driverChip("tmc2209"));
/// x.tmc = tmc;
/// @endcode
struct TmcConfig {
  std::string port;             ///< serial port, such as `/dev/serial0`
  int baud = 115200;            ///< the same for all chips of a port
  int address = 0;              ///< MS1 + 2 MS2; 0 on a TMC2208
  double sense_resistor = 0.0;  ///< [Ohm] of the board
  double run_current = 0.0;     ///< [A rms] of a coil, in motion
  double hold_current = 0.0;    ///< [A rms] at rest, hold_delay after the last step
  double hold_delay = 0.5;      ///< [s]
  ChopperMode mode = ChopperMode::kStealthChop;
  bool interpolate = true;  ///< the chip divides each microstep into steps of 1/256
};

}  // namespace stepdriver::config
