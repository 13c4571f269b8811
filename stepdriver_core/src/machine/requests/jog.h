#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "activity/goal.h"
#include "request_context.h"

namespace stepdriver::machine {

/// Axis::jog()
struct Jog {
  AxisId axis = 0;
  double velocity = 0.0;
  std::optional<std::uint64_t> unless_stopped_since;

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;

  /// @return empty if nothing new must begin. @throw Refused
  std::optional<activity::Goal> goalOf(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
