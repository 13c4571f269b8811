#pragma once

#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// Axis::moveRounds()
struct MoveRounds {
  AxisId axis = 0;
  double rounds = 0.0;
  double velocity = 0.0;

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
