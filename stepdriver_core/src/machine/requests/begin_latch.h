#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "request_context.h"
#include "stepdriver_core/machine/io.h"

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
  using Outcome = axis::Outcome<axis::MoveResult>;

  void serve(RequestContext& machine, const SharedCall& /*call*/) const { begin(machine, {}); }
  /// @param motion see PositionLatches::Subject; may be empty.
  void begin(RequestContext& machine, std::optional<std::weak_ptr<const Outcome>> motion) const;
};

}  // namespace stepdriver::machine
