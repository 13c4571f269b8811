#pragma once

#include <string>

namespace stepdriver::axis {

/// The state of the whole machine, independent of its axes.
struct MachineMode {
  bool held = false;            ///< a feed hold lasts, moving or not, until resume or stop
  double speed_override = 1.0;  ///< the factor of all velocities
  /// The motors' power is there, or nothing switches it. Only activity::MotorPower changes this.
  bool powered = true;
  std::string closed;  ///< why every command is refused; empty: the machine is open
};

}  // namespace stepdriver::axis
