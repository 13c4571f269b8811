#include "end_latch.h"

#include <fmt/format.h>

namespace stepdriver::machine {

std::string EndLatch::text(const AxisWords& /*axes*/) const {
  return fmt::format("end latch {}", id);
}

void EndLatch::serve(RequestContext& machine, const SharedCall& /*call*/) const {
  machine.latches.end(id, "it was ended");
}

}  // namespace stepdriver::machine
