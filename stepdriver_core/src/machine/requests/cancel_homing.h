#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "request_context.h"

namespace stepdriver::machine {

/// The caller of these homings no longer waits.
struct CancelHoming {
  std::vector<std::uint64_t> ids;

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
