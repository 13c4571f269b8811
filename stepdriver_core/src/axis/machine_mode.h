#pragma once

#include <string>

namespace stepdriver::axis {

/// The state of the whole machine, independent of its axes.
struct MachineMode {
  bool held = false;            ///< by a feed hold, moving or not, until resume or stop
  double speed_override = 1.0;  ///< of all velocities
  std::string closed;           ///< why every command is refused; empty: the machine is open
};

}  // namespace stepdriver::axis
