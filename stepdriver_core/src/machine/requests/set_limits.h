#pragma once

#include <string>

#include "request_context.h"
#include "stepdriver_core/axis/axis.h"

namespace stepdriver::machine {

/// Axis::setLimits()
struct SetLimits {
  AxisId axis = 0;
  axis::AxisLimits limits;

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
