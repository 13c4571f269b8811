#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include <cstdint>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/machine/step_rates.h"

namespace stepdriver::ros_node {

/// What diagnostics say of the pulse engine.
struct EngineReading {
  machine::EngineFigures figures;
  std::uint64_t slips_before = 0;  ///< at the reading before this one
  double max_lateness = 0.0;       ///< [s] MachineOptions::max_lateness
  /// What the machine holds as measured, of what the axes ask for; empty: it wasn't measured.
  std::vector<machine::StepRate> rates;
  /// The same of what the motions under way ask for; without the axes at rest.
  std::vector<machine::StepRate> rates_in_motion;
};

/// Below this ratio of the step rate that is held to the one of a motion it warns.
constexpr double kLeastMargin = 1.25;
/// From this part of max_lateness on it warns.
constexpr double kLatenessPart = 0.5;

/// ERROR: in the last second a pulse was later than max_lateness, or a motion under way asks for
/// more than the machine holds. WARN: it is near to one of these, an axis may ask for more than the
/// machine holds, or late pulses made the timeline slide.
void reportEngine(const EngineReading& reading,
                  diagnostic_updater::DiagnosticStatusWrapper& status);

}  // namespace stepdriver::ros_node
