#pragma once

#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// Refuses every request from now on, and brings all axes to rest.
struct Close {
  std::string reason;

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
