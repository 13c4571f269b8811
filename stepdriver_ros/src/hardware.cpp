#include "hardware.h"

#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"

namespace stepdriver::ros_node {
namespace {

std::unique_ptr<Simulation> makeSimulation(const NodeConfig& config, const std::string& node_name) {
  try {
    return std::make_unique<Simulation>(config.axes, config.emergency_stop, config.simulation);
  } catch (const Error& error) {
    throw ConfigError(
        {{node_name + "/simulation/trace", std::string("is wrong: ") + error.what()}});
  }
}

}  // namespace

Hardware::Hardware(const NodeConfig& config, const std::string& node_name) {
  if (config.backend == GpioBackend::kSimulated) {
    simulation_ = makeSimulation(config, node_name);
  } else {
    gpio_ = gpio::makeLibgpiodBackend();
  }
}

gpio::Backend& Hardware::backend() { return simulation_ ? simulation_->backend() : *gpio_; }

pulse::Clock& Hardware::clock() {
  if (simulation_) return simulation_->clock();
  return clock_;
}

std::string Hardware::description() const {
  if (simulation_) return "the simulated rig";
  return "GPIO lines (libgpiod " + gpio::libgpiodVersion() + ")";
}

}  // namespace stepdriver::ros_node
