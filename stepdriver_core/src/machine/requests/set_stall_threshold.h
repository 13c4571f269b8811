#pragma once

#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// Axis::setStallThreshold()
struct SetStallThreshold {
  AxisId axis = 0;
  int threshold = 0;  // see config::StallConfig

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
