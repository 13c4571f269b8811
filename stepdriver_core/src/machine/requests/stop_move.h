#pragma once

#include <cstdint>
#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// Axis::stop() of a move: only if the axis still makes this move, or holds it.
struct StopMove {
  AxisId axis = 0;
  std::uint64_t move = 0;

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
