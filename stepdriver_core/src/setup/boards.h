#pragma once

#include <memory>
#include <vector>

#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/setup/machine_config.h"

namespace stepdriver::setup {

/// The lines of boards around those of another backend.
///
/// @param base, clock outlive it. @param simulated the boards are fake ones, whose pins are lines
/// of
///   the base.
std::unique_ptr<gpio::Backend> makeBoards(const std::vector<BoardConfig>& boards,
                                          gpio::Backend& base, pulse::Clock& clock, bool simulated);

}  // namespace stepdriver::setup
