#pragma once

#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// Axis::setCurrent()
struct SetCurrent {
  AxisId axis = 0;
  double run = 0.0;   // [A rms]; 0: as configured
  double hold = 0.0;  // the same

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
