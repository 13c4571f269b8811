#pragma once

#include <string>
#include <vector>

#include "request_context.h"

namespace stepdriver::machine {

/// Axis::home(), Axis::checkHoming() and Machine::home()
struct Home {
  std::vector<AxisId> axes;
  bool only_check = false;

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& words) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
