#pragma once

#include <string>

#include "axis/axis_memory.h"
#include "request_context.h"

namespace stepdriver::machine {

/// An axis gets the position that the state file has kept, if that is possible.
struct RestorePosition {
  AxisId axis = 0;
  axis::AxisMemory memory;
  bool clean = false;
  std::string source;  ///< names the file, for messages

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
