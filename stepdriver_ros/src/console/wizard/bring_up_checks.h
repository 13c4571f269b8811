#pragma once

#include "dialogue.h"
#include "findings.h"
#include "machine_at_hand.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// The checks of one axis, one after the other. Each adds its findings, and moves nothing without a
/// question.

/// Do the switches read right? The user presses each by hand; nothing moves. This comes first,
/// because no axis should move while its switches may be dead.
void checkSwitches(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                   Findings& findings);

/// Which way is plus?
void checkDirection(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                    Findings& findings);

/// Is the distance right? Takes up the play, makes a move, and asks for the measured distance.
void checkDistance(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                   Findings& findings);

}  // namespace stepdriver::console
