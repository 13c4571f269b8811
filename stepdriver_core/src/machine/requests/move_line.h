#pragma once

#include <string>
#include <vector>

#include "request_context.h"

namespace stepdriver::machine {

/// Machine::moveLine()
struct MoveLine {
  std::vector<AxisId> axes;
  std::vector<double> positions;
  bool relative = false;
  double velocity = 0.0;
  double duration = 0.0;

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& words) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
