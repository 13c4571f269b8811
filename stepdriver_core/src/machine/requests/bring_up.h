#pragma once

#include <map>
#include <string>

#include "axis/axis_memory.h"
#include "request_context.h"

namespace stepdriver::machine {

/// The machine begins: the motors get the states that are configured.
struct BringUp {
  static constexpr bool kReadsInputs = false;
  std::map<std::string, axis::AxisMemory> kept;  ///< what is known of axes from an earlier run
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
