#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/setup/simulation_config.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::setup {

/// The limits of the motor that has the pins of an axis: those of the axis, or the most that all
/// axes that share it can demand of it together.
///
/// @param axis its place in `axes`.
/// @throw Error if there is no such axis, or its kinematics doesn't name it.
sim::MotorLimits motorLimits(const std::vector<config::AxisConfig>& axes, std::size_t axis);

/// The motor that has the pins of an axis, on the rig. Without a configured holding torque it has
/// as much as the limits of the axis take, or those of all axes that share it, see
/// sim::soundMotor().
///
/// @param axis its place in `axes`.
sim::MotorSpec motorOf(const std::vector<config::AxisConfig>& axes, std::size_t axis,
                       const SimulatedMotor& simulated = {});

/// The simulated rig of a configuration, its lines and its clock. All calls are safe from any
/// thread.
///
/// @code{.cpp}
/// setup::Hardware hardware(config);
/// if (setup::Simulation* simulation = hardware.simulation()) {
///   simulation->pressEndstop("x", setup::Simulation::End::kMin, true);
///   std::cout << simulation->rig().report("x").carriage << " mm\n";
/// }
/// @endcode
class Simulation {
 public:
  /// @param emergency_stop the machine's input, to which the rig connects a button.
  /// @param motor_power the machine's, for which the rig has a relay.
  /// @param outputs, inputs those with a name.
  /// @throw Error if the trace can't be written, or as sim::Rig.
  Simulation(const std::vector<config::AxisConfig>& axes,
             std::optional<config::InputSwitch> emergency_stop,
             const std::optional<config::MotorPowerConfig>& motor_power,
             const SimulationConfig& config, const std::vector<config::OutputConfig>& outputs = {},
             const std::vector<config::InputConfig>& inputs = {});

  gpio::Backend& backend() { return backend_; }
  pulse::Clock& clock() { return clock_; }

  /// The rig, for its reports and its trace.
  sim::Rig& rig() { return rig_; }

  const std::vector<config::AxisConfig>& axes() const { return axes_; }

  /// Presses the button of the emergency-stop input, or releases it. @throw Refused if no such
  /// input is configured.
  void pressEmergencyStop(bool pressed);

  /// The inputs with a name, which can be pressed.
  const std::vector<config::InputConfig>& inputs() const { return inputs_; }

  /// Presses one of them, or releases it. @throw Error if there is no such input.
  void pressInput(const std::string& name, bool pressed);

  /// An end of an axis, with its switch.
  enum class End { kMin, kMax };
  /// Presses an endstop as if by hand, or releases it. Restarts the counters of the axis's other
  /// configured faults.
  ///
  /// @param axis of the configuration.
  /// @param end of the axis; the wiring determines which lines change: all motors of an axis press
  ///   theirs.
  /// @throw Error if there is no such axis. @throw Refused if it has no switch there.
  void pressEndstop(const std::string& axis, End end, bool pressed);

 private:
  /// For an edge that is being made.
  pulse::Nanoseconds timeOfEdge();

  std::vector<config::AxisConfig> axes_;
  const std::optional<config::InputSwitch> emergency_stop_;
  const std::vector<config::InputConfig> inputs_;
  std::map<std::string, sim::RigFaults> faults_;
  std::mutex mutex_;
  std::map<std::string, sim::RigFaults> pressed_;  // the faults, and the pressed switches
  std::atomic<std::uint64_t> stalls_{0};  // how many stalls of the clock the rig has been told
  pulse::VirtualClock clock_;
  sim::Rig rig_;
  gpio::SimulatedBackend backend_;
};

}  // namespace stepdriver::setup
