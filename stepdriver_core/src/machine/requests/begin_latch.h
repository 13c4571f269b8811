#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "request_context.h"
#include "stepdriver_core/machine/latch.h"

namespace stepdriver::machine {

/// Machine::latch()
struct BeginLatch {
  std::uint64_t id = 0;
  LatchRequest wanted;
  std::vector<AxisId> axes;
  std::optional<AxisId> window_axis;
  std::size_t input = 0;  ///< its number in the configuration
  std::shared_ptr<LatchRecord> record;

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& words) const;
  void serve(RequestContext& machine, const SharedCall& /*call*/) const { begin(machine, {}); }
  /// @param stops see PositionLatches::Subject; may be empty.
  void begin(RequestContext& machine,
             const std::shared_ptr<const axis::Outcome<axis::MoveResult>>& stops) const;
};

}  // namespace stepdriver::machine
