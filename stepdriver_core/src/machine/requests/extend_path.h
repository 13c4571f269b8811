#pragma once

#include <cstdint>
#include <string>

#include "activity/goal.h"
#include "request_context.h"

namespace stepdriver::machine {

/// Machine::appendPath(): continues the path that axes follow.
struct ExtendPath {
  AxisId axis = 0;         ///< one of them
  std::uint64_t move = 0;  ///< the number of that axis's move
  activity::Extension extension;

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
