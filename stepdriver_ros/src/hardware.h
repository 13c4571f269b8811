#pragma once

#include <memory>
#include <string>

#include "node_config.h"
#include "simulation.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::ros_node {

/// What a node drives, and the clock that its pulses are timed by: the machine's GPIO lines on
/// CLOCK_MONOTONIC, or the simulated rig on its own clock. No line is touched by it itself.
class Hardware {
 public:
  /// @param node_name full name of the node. @throw ConfigError where the rig's trace can't be
  /// written.
  Hardware(const NodeConfig& config, const std::string& node_name);

  gpio::Backend& backend();
  pulse::Clock& clock();

  /// "the simulated rig", "GPIO lines (libgpiod 1.6.3)"
  std::string description() const;

  /// @return null: the lines are real.
  Simulation* simulation() { return simulation_.get(); }

 private:
  std::unique_ptr<Simulation> simulation_;
  // Where there is no simulation:
  std::unique_ptr<gpio::Backend> gpio_;
  pulse::SteadyClock clock_;
};

}  // namespace stepdriver::ros_node
