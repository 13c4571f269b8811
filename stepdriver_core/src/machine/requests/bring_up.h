#pragma once

#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// The machine begins: the motors get the states that are configured.
struct BringUp {
  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
