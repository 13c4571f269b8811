#pragma once

#include "dialogue.h"
#include "findings.h"
#include "machine_at_hand.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// All checks of an axis. Its motor gets current only after a question, and where it had none
/// before, it has none afterwards, however this ends.
///
/// @throw Ended, and Error where the driver goes away.
Findings bringUp(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config);

}  // namespace stepdriver::console
