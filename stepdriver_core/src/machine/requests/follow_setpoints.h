#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "request_context.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::machine {

/// A setpoint of one axis.
struct Setpoint {
  AxisId axis = 0;
  double value = 0.0;  ///< [unit] or [unit/s]
  std::optional<std::uint64_t> unless_stopped_since;
};

/// Machine::followSetpoints(): setpoints that take effect at the same motion time; answered with
/// activity::Refusals.
struct FollowSetpoints {
  SetpointMode mode = SetpointMode::kPosition;
  double timeout = 0.0;  ///< [s]
  std::vector<Setpoint> setpoints;

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
