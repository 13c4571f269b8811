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
/// On a machine that stalls pulses come late: then later ones do, too, but they come never closer
/// than three quarters of their planned interval, and none is left out.
namespace stepdriver::kernel {

/// The shortest that an interval may become.
std::int64_t closest(std::int64_t planned_interval);

/// STEP, DIR and ENABLE in a row.
Place placeAt(const std::string& chip, unsigned first, bool inverted = false);

class MachineWaveform : public testing::Test {
 protected:
  void SetUp() override;

  /// Ends the machine, reads the lines of its axes, and expects what holds for every machine. What
  /// all tests have read is printed at the end.
  /// @param axes those of the machine, at the speed of axisAt().
  std::map<std::string, Waveform> read(KernelBench& bench,
                                       const std::vector<config::AxisConfig>& axes);

  std::unique_ptr<KernelTrace> trace;  ///< after read()
};

/// Holds pulses against the steps that were planned for them, from the pulse `first` on.
///
/// The timeline may only slide to later: what a pulse is late by is made up for by at most the part
/// of the next interval that closest() leaves.
/// @param count of steps; there may be more of both.
void expectAsPlanned(const std::vector<Pulse>& pulses, std::size_t first,
                     const std::vector<motion::Step>& steps, std::size_t count);

/// Moves by microsteps, one after the other from 0.
using Moves = std::vector<std::int64_t>;

/// Holds all pulses of an axis against what was planned for its moves.
void expectAsPlanned(const Waveform& seen, const Moves& moves, const config::AxisConfig& config);

}  // namespace stepdriver::kernel
