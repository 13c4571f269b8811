#pragma once

#include <string>

#include "activity/goal.h"
#include "request_context.h"

namespace stepdriver::machine {

/// Axis::moveTo()
struct MoveTo {
  AxisId axis = 0;
  double position = 0.0;
  bool relative = false;
  double velocity = 0.0;
  bool shortest = false;

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;

  /// "x to 0.1 m"
  std::string goalText(const AxisWords& axes) const;
  /// @throw Refused
  activity::Goal goalOf(RequestContext& machine) const;
};

}  // namespace stepdriver::machine
