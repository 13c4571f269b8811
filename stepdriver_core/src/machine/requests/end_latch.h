#pragma once

#include <cstdint>
#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// Machine::end() of a latch
struct EndLatch {
  std::uint64_t id = 0;

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
