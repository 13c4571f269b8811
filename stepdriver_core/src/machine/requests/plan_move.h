#pragma once

#include <string>

#include "move_to.h"
#include "request_context.h"

namespace stepdriver::machine {

/// Axis::plan()
struct PlanMove {
  MoveTo move;

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
