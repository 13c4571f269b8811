#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/setup/machine_config.h"
#include "stepdriver_core/setup/simulation.h"

namespace stepdriver::setup {

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

}  // namespace stepdriver::setup
