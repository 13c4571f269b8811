#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::ros_node {

/// What diagnostics say of an axis.
struct AxisReading {
  axis::AxisState state;
  axis::AxisLimits limits;
  axis::EndstopState endstops;
  std::string endstop_error;  ///< why they couldn't be read; empty: they could
};

/// Near a soft limit is what is within this part of the way between the two; where there is one
/// alone, what is at it.
constexpr double kNearLimit = 0.01;

/// ERROR: a fault, with what ends it, or an endstop that can't be read. WARN: the position is
/// unverified, an endstop is active, or it stands or moves near a soft limit.
void reportAxis(const config::AxisConfig& config, const AxisReading& reading,
                diagnostic_updater::DiagnosticStatusWrapper& status);

}  // namespace stepdriver::ros_node
