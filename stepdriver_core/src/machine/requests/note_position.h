#pragma once

#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// Why the state file has no position for an axis.
struct NotePosition {
  AxisId axis = 0;
  std::string why;

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
