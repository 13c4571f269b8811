#pragma once

#include <vector>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::axis {

constexpr int kUnknownMscnt = -1;

/// The part of an axis's state that outlives the program; see machine::StateFile.
struct AxisMemory {
  config::Kind kind = config::Kind::kLinear;
  double steps_per_unit = 0.0;  ///< [steps/unit] as configured
  double position = 0.0;        ///< [unit] at rest, or where the current motion began
  double slack = 0.0;           ///< [unit] the part of the backlash that is taken up
  bool valid = false;           ///< the position could be trusted
  bool homed = false;
  bool at_home = false;  ///< the chip's translator was in its state after a reset
  bool moving = false;
  /// [1/256 full step] MSCNT of the driver of each motor that has one with registers, or the place
  /// of the pattern of its coils if lines switch them, of this axis and then of those that share
  /// its motors; or kUnknownMscnt.
  std::vector<int> mscnt;

  bool operator==(const AxisMemory& other) const {
    return kind == other.kind && steps_per_unit == other.steps_per_unit &&
           position == other.position && slack == other.slack && valid == other.valid &&
           homed == other.homed && at_home == other.at_home && moving == other.moving &&
           mscnt == other.mscnt;
  }
};

}  // namespace stepdriver::axis
