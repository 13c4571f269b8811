#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/setup/simulation_config.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::setup {

/// The simulated rig of a configuration, its lines, and the clock that it lives on.
/// All calls are safe from any thread.
class Simulation {
 public:
  /// @param emergency_stop the input of the machine, with a button at it.
  /// @throw Error where the trace can't be written.
  Simulation(const std::vector<config::AxisConfig>& axes,
             std::optional<config::InputSwitch> emergency_stop, const SimulationConfig& config);

  gpio::Backend& backend() { return backend_; }
  pulse::Clock& clock() { return clock_; }

  /// The rig, for its reports and its trace.
  sim::Rig& rig() { return rig_; }

  const std::vector<config::AxisConfig>& axes() const { return axes_; }

  /// Presses the button of the emergency-stop input, or releases it. @throw Refused where none is
  /// configured.
  void pressEmergencyStop(bool pressed);

  /// An end of an axis, with its switch.
  enum class End { kMin, kMax };
  /// Presses an endstop by hand, or lets it go. What else is wrong with the axis by configuration
  /// counts from here on anew.
  ///
  /// @param axis of the configuration.
  /// @param end of the axis; which line that changes is a matter of the wiring.
  void pressEndstop(const std::string& axis, End end, bool pressed);

 private:
  std::vector<config::AxisConfig> axes_;
  const std::optional<config::InputSwitch> emergency_stop_;
  std::map<std::string, sim::RigFaults> faults_;
  std::mutex mutex_;
  std::map<std::string, sim::RigFaults> pressed_;  // faults, and the switches that are pressed
  pulse::VirtualClock clock_;
  sim::Rig rig_;
  gpio::SimulatedBackend backend_;
};

}  // namespace stepdriver::setup
