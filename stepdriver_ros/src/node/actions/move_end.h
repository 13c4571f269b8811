#pragma once

#include <stepdriver/MoveLineResult.h>
#include <stepdriver/MoveResult.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "stepdriver_core/axis/axis.h"

namespace stepdriver::ros_node {

/// How a motion ended, as a constant of MoveResult; those of MoveLineResult are the same.
inline int endOf(axis::MoveEnd end) {
  switch (end) {
    case axis::MoveEnd::kReached:
      return MoveResult::REACHED;
    case axis::MoveEnd::kStopped:
      return MoveResult::STOPPED;
    case axis::MoveEnd::kReplaced:
      return MoveResult::REPLACED;
    case axis::MoveEnd::kEndstopMin:
      return MoveResult::ENDSTOP_MIN;
    case axis::MoveEnd::kEndstopMax:
      return MoveResult::ENDSTOP_MAX;
    case axis::MoveEnd::kEmergencyStop:
      return MoveResult::EMERGENCY_STOP;
    case axis::MoveEnd::kFault:
    case axis::MoveEnd::kCompanion:  // never what ended a motion first
      break;
  }
  return MoveResult::FAULT;
}
static_assert(static_cast<int>(MoveResult::REACHED) == MoveLineResult::REACHED &&
              static_cast<int>(MoveResult::STOPPED) == MoveLineResult::STOPPED &&
              static_cast<int>(MoveResult::REPLACED) == MoveLineResult::REPLACED &&
              static_cast<int>(MoveResult::ENDSTOP_MIN) == MoveLineResult::ENDSTOP_MIN &&
              static_cast<int>(MoveResult::ENDSTOP_MAX) == MoveLineResult::ENDSTOP_MAX &&
              static_cast<int>(MoveResult::EMERGENCY_STOP) == MoveLineResult::EMERGENCY_STOP &&
              static_cast<int>(MoveResult::FAULT) == MoveLineResult::FAULT &&
              static_cast<int>(MoveResult::REFUSED) == MoveLineResult::REFUSED);

/// The covered part of a way, from 0 to 1.
inline double progressOf(double from, double position, double target) {
  const double way = std::abs(target - from);
  return way > 0.0 ? std::clamp(1.0 - std::abs(target - position) / way, 0.0, 1.0) : 1.0;
}

/// Reports the end of a motion to the client. @param preempted_by a cancel in words; empty: none.
template <typename Handle, typename Result>
void reportEnd(Handle& handle, const Result& result, const std::string& preempted_by) {
  if (result.end == Result::REACHED) {
    handle.setSucceeded(result, result.message);
  } else if (result.end == Result::REPLACED || !preempted_by.empty()) {
    handle.setCanceled(result, result.message);
  } else {
    handle.setAborted(result, result.message);
  }
}

}  // namespace stepdriver::ros_node
