#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"

/// Lines with a name, which belong to a machine and to none of its axes.
namespace stepdriver::config {

/// What the position of an axis makes an output do: position compare for a camera or a dispenser,
/// cam switches for a valve. Each action comes at the nanosecond at which the joint arrives at its
/// place, and never stops the axis.
struct PositionCompare {
  /// In which the axis must move.
  enum class Direction { kBoth, kUp, kDown };
  /// On between two places.
  struct Cam {
    double from = 0.0;  ///< [m] or [rad], as all places of the axis
    double to = 0.0;
  };
  /// A pulse at `from`, and then at each further `distance` as far as `to`.
  struct Every {
    double distance = 0.0;  ///< [m] or [rad]
    double from = 0.0;
    double to = 0.0;
  };
  std::string axis;
  Direction direction = Direction::kBoth;
  /// @name Either cams, or pulses at any of the others
  /// @{
  std::vector<Cam> cams;
  std::vector<double> places;  ///< a pulse at each
  std::optional<Every> every;
  bool at_end = false;  ///< a pulse when a motion has come to its target
  /// @}
  std::int64_t pulse_ns = 0;  ///< how long a pulse is on
  /// [ns] How much earlier it is switched than at the place: for what needs time to act.
  std::int64_t lead_on_ns = 0;
  std::int64_t lead_off_ns = 0;
};

/// An output: a relay, a pump, a laser, the magnet that lifts a pen.
///
/// @code{.cpp}
/// config::OutputConfig pump;
/// pump.name = "pump";
/// pump.line = "gpiochip0:5";
/// pump.at_stop = false;              // Machine::stop() switches it off
/// pump.max_on_ns = 60'000'000'000;  // and so does a minute
/// machine::MachineOptions options;
/// options.outputs = {pump};
/// @endcode
struct OutputConfig {
  std::string name;
  std::string line;
  bool active_level = true;  ///< level of the line while the output is on
  bool initial = false;      ///< whether it is on from the start of the machine
  /// Whether Machine::stop() switches it on or off; empty: it stays as it is.
  std::optional<bool> at_stop;
  /// Whether it is on in its safe state: at an emergency stop and at a fault of any axis until
  /// recover(), from the beginning of a shutdown on, and before and after the machine has the line.
  /// A pull resistor should give the line that level.
  bool at_fault = false;
  /// [ns] It is switched off when it has been on for this long; empty: it may stay on.
  std::optional<std::int64_t> max_on_ns;
  /// [ns] How long it stays on, or off, at least; a PWM output for its period in any case. The safe
  /// state doesn't wait for that.
  std::int64_t min_on_ns = 0;
  std::int64_t min_off_ns = 0;
  /// From the start on, until Machine::setPositionCompare() or clearPositionCompare().
  std::optional<PositionCompare> compare{};

  bool level(bool on) const { return on == active_level; }
};

/// An input: a sensor, a probe, a button.
struct InputConfig {
  std::string name;
  InputSwitch line;
  /// [ns] A change counts when the level has stayed for this long; 0: each level that is read.
  std::int64_t debounce_ns = 0;
};

/// A relay or contactor that switches the power of all motors of a machine. It is switched on
/// before the first motor gets current, and off after an emergency stop, after a fault of its own,
/// and at the end.
struct MotorPowerConfig {
  std::string line;
  bool active_level = true;  ///< level of the line that switches the power on
  /// [ns] From that level until the power is there and the drivers have started.
  std::int64_t on_ns = 0;
  /// [ns] From the last pulse of an emergency stop until the power is switched off, at least: it
  /// also waits until each brake holds and each motor that must be disabled is.
  std::int64_t off_delay_ns = 0;
  /// A contact that is active while the power is there.
  std::optional<InputSwitch> feedback;
  /// [ns] How long the feedback may take to follow the line.
  std::int64_t feedback_timeout_ns = 1'000'000'000;
};

}  // namespace stepdriver::config
