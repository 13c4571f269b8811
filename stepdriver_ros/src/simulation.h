#pragma once

#include <stepdriver/RigReport.h>

#include <memory>
#include <vector>

#include "simulation_config.h"
#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::ros_node {

/// Checks what a simulation needs of its axes.
///
/// @param name full name of the map `simulation`.
/// @param issues everything that is wrong is added here.
void checkSimulation(const std::vector<axis::AxisConfig>& axes, const SimulationConfig& config,
                     const std::string& name, std::vector<ConfigIssue>& issues);

/// The simulated rig of a node, the lines that it is wired to, and the clock that it lives on.
/// All calls are safe from any thread.
class Simulation {
 public:
  /// @throw Error where the trace can't be written.
  Simulation(const std::vector<axis::AxisConfig>& axes, const SimulationConfig& config);

  gpio::Backend& backend() { return backend_; }
  pulse::Clock& clock() { return clock_; }

  /// Also makes the trace readable up to now. @throw Error where the trace can't be written.
  RigReport::Response report();

 private:
  std::vector<axis::AxisConfig> axes_;
  pulse::VirtualClock clock_;
  sim::Rig rig_;
  gpio::SimulatedBackend backend_;
};

}  // namespace stepdriver::ros_node
