#pragma once

#include <vector>

#include "stepdriver_core/machine/machine.h"

namespace stepdriver::test {

/// A machine on a virtual clock, which has no threads unless a test wants them: waiting calls and
/// advance() serve its pulses.
class UnthreadedMachine : public machine::Machine {
 public:
  UnthreadedMachine(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend,
                    pulse::Clock& clock, const machine::MachineOptions& options = {},
                    bool threaded = false)
      : Machine(axes, backend, clock, options, threaded ? ServedBy::kThreads : ServedBy::kCallers) {
  }

  using Machine::advance;
};

}  // namespace stepdriver::test
