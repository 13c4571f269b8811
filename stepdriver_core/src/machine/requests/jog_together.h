#pragma once

#include <string>
#include <vector>

#include "jog.h"
#include "request_context.h"

namespace stepdriver::machine {

/// Machine::jog(): jogs that begin at the same motion time; answered with activity::Refusals.
struct JogTogether {
  std::vector<Jog> jogs;

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
