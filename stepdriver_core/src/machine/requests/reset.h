#pragma once

#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// Axis::reset()
struct Reset {
  AxisId axis = 0;

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
