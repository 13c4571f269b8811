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
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/setup/machine_config.h"
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

/// The lines of a configured machine, and the clock that times its pulses: the GPIO lines of this
/// computer on CLOCK_MONOTONIC, or the simulated rig on a clock of its own. No line is touched
/// until a machine::Machine requests the lines.
///
/// @code{.cpp}
/// setup::Hardware hardware(config);
/// std::cout << hardware.description() << "\n";  // "the simulated rig"
/// @endcode
class Hardware {
 public:
  /// @param name of the map that the configuration was read from, for messages; it may be empty.
  /// @throw ConfigError if the rig's trace can't be written, or as machine::Machine.
  /// @throw GpioError if the backend is libgpiod and stepdriver was built without it.
  explicit Hardware(const MachineConfig& config, const std::string& name = "");
  ~Hardware();

  gpio::Backend& backend();
  pulse::Clock& clock();

  /// "the simulated rig", "GPIO lines (libgpiod 1.6.3)"
  std::string description() const;

  /// @return nullptr if the lines are real.
  Simulation* simulation() { return simulation_.get(); }

 private:
  std::unique_ptr<Simulation> simulation_;
  // If there is no simulation:
  std::unique_ptr<gpio::Backend> gpio_;
  pulse::SteadyClock clock_;
  std::unique_ptr<gpio::Backend> boards_;  // around the others; empty: there are no boards
  std::size_t board_count_ = 0;
};

/// What a check of the drivers has found: "x: the TMC2209 answers on /dev/serial0 at address 0".
struct DriverFinding {
  bool is_right = false;
  std::string text;  ///< with the likely cause if it isn't right
};

/// Asks the drivers that have a config::TmcConfig whether they are there, and which chip they are,
/// while no machine uses them.
///
/// @param wiring whether to test the lines to ENABLE, STEP and DIR too. Nothing moves: the outputs
///   of all these chips are switched off by their registers first, and stay off until a
///   machine::Machine has set them up. If one of them can't be switched off, no line is touched.
///   Then each line is driven to both levels, and the chips are asked which of their pins follows.
/// @return for each driver one finding, and then one for each of its lines.
/// @throw GpioError if a line can't be requested or written.
///
/// @code{.cpp}
/// for (const setup::DriverFinding& found : setup::checkDrivers(config.axes, backend, true)) {
///   std::cout << (found.is_right ? "   " : "!! ") << found.text << "\n";
/// }
/// @endcode
std::vector<DriverFinding> checkDrivers(const std::vector<config::AxisConfig>& axes,
                                        gpio::Backend& backend, bool wiring);

/// Asks the boards which firmware they have, while no machine uses them. Nothing is configured, and
/// nothing moves.
///
/// @return for each board one finding: "mcu: rp2040 at 12 MHz, firmware v0.12.0".
std::vector<DriverFinding> checkBoards(const std::vector<BoardConfig>& boards);

}  // namespace stepdriver::setup
