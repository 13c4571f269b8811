#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "kernel_bench.h"
#include "kernel_trace.h"
#include "profile/step_finder.h"
#include "stepdriver_core/config/axis_config.h"
#include "waveform.h"

/// What the kernel's lines did while whole machines moved, compared with the plan and the chips.
///
/// On a machine that stalls, pulses come late. Then later pulses come late, too, except for what
/// may be made up for, and none is left out.
namespace stepdriver::kernel {

/// [ns] By how much a late pulse may be made up for: a quarter of a full step, at most 2 ms, or a
/// quarter of the planned interval. 1/32 is the finest mode here.
std::int64_t madeUp(std::int64_t planned_interval);

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
/// The timeline may only slide to later times. A late pulse is made up for by at most madeUp().
/// @param count number of steps to compare. There may be more steps and pulses.
void expectAsPlanned(const std::vector<Pulse>& pulses, std::size_t first,
                     const std::vector<motion::Step>& steps, std::size_t count);

/// Moves by microsteps, one after the other from 0.
using Moves = std::vector<std::int64_t>;

/// Compares all pulses of an axis with the plans of its moves.
void expectAsPlanned(const Waveform& seen, const Moves& moves, const config::AxisConfig& config);

}  // namespace stepdriver::kernel
