#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "kernel_bench.h"
#include "kernel_trace.h"
#include "motion/step_finder.h"
#include "stepdriver_core/config/axis_config.h"
#include "waveform.h"

/// What the kernel's lines did while whole machines moved, compared with the plan and the chips.
///
/// On a machine that stalls, pulses come late. Then later pulses come late, too, but they are never
/// closer than three quarters of their planned interval, and none is left out.
namespace stepdriver::kernel {

/// The shortest allowed interval, from the planned one.
std::int64_t closest(std::int64_t planned_interval);

/// The lines of STEP, DIR and ENABLE, in this order.
Place placeAt(const std::string& chip, unsigned first, bool inverted = false);

class MachineWaveform : public testing::Test {
 protected:
  void SetUp() override;

  /// Shuts the machine down, reads the lines of its axes, and expects what is true for every
  /// machine. A summary of everything that the tests have read is printed at the end.
  /// @param axes of the machine, at the speed of axisAt().
  std::map<std::string, Waveform> read(KernelBench& bench,
                                       const std::vector<config::AxisConfig>& axes);

  std::unique_ptr<KernelTrace> trace;  ///< after read()
};

/// Compares pulses with the planned steps, beginning with the pulse `first`.
///
/// The timeline may only slide to later times. A late pulse is made up for by at most the part of
/// the next interval that closest() leaves.
/// @param count number of steps to compare; there may be more steps and pulses.
void expectAsPlanned(const std::vector<Pulse>& pulses, std::size_t first,
                     const std::vector<motion::Step>& steps, std::size_t count);

/// Moves by microsteps, one after the other from 0.
using Moves = std::vector<std::int64_t>;

/// Compares all pulses of an axis with the plans of its moves.
void expectAsPlanned(const Waveform& seen, const Moves& moves, const config::AxisConfig& config);

}  // namespace stepdriver::kernel
