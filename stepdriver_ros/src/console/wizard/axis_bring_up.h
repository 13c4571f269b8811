#pragma once

#include "dialogue.h"
#include "findings.h"
#include "machine_at_hand.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// All checks of an axis. The motor is enabled only after a question, and if it was disabled
/// before, it is disabled afterwards, however this ends.
///
/// @throw Ended, and Error if the driver goes away.
Findings bringUp(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config);

}  // namespace stepdriver::console
