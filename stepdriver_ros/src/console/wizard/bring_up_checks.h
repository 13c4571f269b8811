#pragma once

#include "dialogue.h"
#include "findings.h"
#include "machine_at_hand.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// One after the other, for one axis; each adds what it has found out, and moves nothing without a
/// question.

/// Do the switches read right? Each is pressed by hand; nothing moves. It comes first: nobody
/// should move an axis whose switches may be dead.
void checkSwitches(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                   Findings& findings);

/// Which way is plus?
void checkDirection(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                    Findings& findings);

/// Is the distance right? By the play's taking up, a move and a rule.
void checkDistance(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                   Findings& findings);

}  // namespace stepdriver::console
