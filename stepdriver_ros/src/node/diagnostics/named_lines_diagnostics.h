#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include "stepdriver_core/machine/io.h"

namespace stepdriver::ros_node {

/// Reports the lines with a name: each with its state, and those that can't be written or read.
void reportNamedLines(const machine::IoStates& states,
                      diagnostic_updater::DiagnosticStatusWrapper& status);

}  // namespace stepdriver::ros_node
