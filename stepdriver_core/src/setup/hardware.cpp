#include "stepdriver_core/setup/hardware.h"

#include "machine/read_options.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"

namespace stepdriver::setup {
namespace {

std::unique_ptr<Simulation> makeSimulation(const MachineConfig& config, const std::string& name) {
  try {
    return std::make_unique<Simulation>(config.axes, config.emergency_stop, config.motor_power,
                                        config.simulation, config.outputs, config.inputs);
  } catch (const Error& error) {
    const std::string key = "simulation/trace";
    throw ConfigError(
        {{name.empty() ? key : name + "/" + key, std::string("is wrong: ") + error.what()}});
  }
}

}  // namespace

Hardware::Hardware(const MachineConfig& config, const std::string& name) {
  machine::checkConfiguration(config.axes, config.options());
  if (config.backend == GpioBackend::kSimulated) {
    simulation_ = makeSimulation(config, name);
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

}  // namespace stepdriver::setup
