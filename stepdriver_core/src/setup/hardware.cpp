#include "stepdriver_core/setup/hardware.h"

#include <fmt/format.h>

#include "boards.h"
#include "gpio/pwm_backend.h"
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
    gpio_ = gpio::withPwm(gpio::makeLibgpiodBackend(), "/sys/class/pwm");
  }
  board_count_ = config.boards.size();
  if (board_count_ != 0) boards_ = makeBoards(config.boards, backend(), clock(), !!simulation_);
}

Hardware::~Hardware() = default;

gpio::Backend& Hardware::backend() {
  if (boards_) return *boards_;
  return simulation_ ? simulation_->backend() : *gpio_;
}

pulse::Clock& Hardware::clock() {
  if (simulation_) return simulation_->clock();
  return clock_;
}

std::string Hardware::description() const {
  const std::string boards = board_count_ == 0
                                 ? ""
                                 : fmt::format(" and {} board{} with Klipper's firmware",
                                               board_count_, board_count_ == 1 ? "" : "s");
  if (simulation_) return "the simulated rig" + boards;
  return "GPIO lines (libgpiod " + gpio::libgpiodVersion() + ")" + boards;
}

}  // namespace stepdriver::setup
