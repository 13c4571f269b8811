#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include <cstdint>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/machine/step_rates.h"

namespace stepdriver::ros_node {

/// The facts about the pulse engine for diagnostics.
struct EngineReading {
  machine::EngineFigures figures;
  std::uint64_t slips_before = 0;  ///< the slips at the previous reading
  double max_lateness = 0.0;       ///< [s] MachineOptions::max_lateness
  /// The measured step rates, with the needs of the axes; empty: not measured.
  std::vector<machine::StepRate> rates;
  /// The same for the current motions, without the axes at rest.
  std::vector<machine::StepRate> rates_in_motion;
};

/// It warns below this ratio of the sustainable step rate to that of a motion.
constexpr double kLeastMargin = 1.25;
/// It warns from this part of max_lateness on.
constexpr double kLatenessPart = 0.5;

/// ERROR: in the last second a pulse was later than max_lateness, or a current motion needs more
/// than the computer can sustain. WARN: one of these is close, an axis may need more than the
/// computer can sustain, or late pulses made the timeline slide.
void reportEngine(const EngineReading& reading,
                  diagnostic_updater::DiagnosticStatusWrapper& status);

}  // namespace stepdriver::ros_node
