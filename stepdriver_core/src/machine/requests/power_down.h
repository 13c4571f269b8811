#pragma once

#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// Disables the axes that are configured so.
struct PowerDown {
  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
