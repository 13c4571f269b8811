#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::ros_node {

/// The facts about an axis for diagnostics.
struct AxisReading {
  axis::AxisState state;
  axis::AxisLimits limits;
  axis::EndstopState endstops;
  std::string endstop_error;  ///< why they couldn't be read; empty if they were read
};

/// Near a soft limit means within this part of the distance between the two; if there is only one,
/// at the limit.
constexpr double kNearLimit = 0.01;

/// ERROR: a fault, with its remedy, or an endstop that can't be read. WARN: the position is
/// unverified, an endstop is active, or the axis is near a soft limit.
void reportAxis(const config::AxisConfig& config, const AxisReading& reading,
                diagnostic_updater::DiagnosticStatusWrapper& status);

}  // namespace stepdriver::ros_node
