#pragma once

#include <memory>
#include <string>
#include <utility>
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
  bool continues = false;  ///< see continueTo()

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& words) const;
  void serve(RequestContext& machine, const SharedCall& call) const { begin(machine, call); }
  /// The targets are places on the way of a relative line before it, so they need no homing.
  void continueTo(const std::vector<double>& places) {
    positions = places;
    continues = std::exchange(relative, false);
  }
  /// @return how the first of its axes ends it, once it has. @throw Refused
  std::shared_ptr<const axis::Outcome<axis::MoveResult>> begin(RequestContext& machine,
                                                               const SharedCall& call) const;
};

}  // namespace stepdriver::machine
