#pragma once

#include <string>
#include <vector>

#include "request_context.h"

namespace stepdriver::machine {

/// Axis::enable() and Machine::enable(): all of the axes, or none if one is refused.
struct Enable {
  std::vector<AxisId> axes;
  bool on = false;

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& words) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
