#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "begin_latch.h"
#include "move_line.h"

namespace stepdriver::machine {

/// A stroke of Machine::probe(): a line whose axes come to rest at an edge, or one that goes back.
struct ProbeStroke {
  MoveLine line;
  std::optional<BeginLatch> latch;  ///< of the axes of the line; empty: it goes back
  bool is_first = true;
  /// AxisSnapshot::stopsOtherThanHolds() of each axis when the probing began: whatever stops one of
  /// them ends it.
  std::vector<std::uint64_t> stops;
  /// [unit] Where each axis stood when it began; serve() writes it before the answer.
  std::shared_ptr<std::vector<double>> begin = std::make_shared<std::vector<double>>();

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& words) const;
  void serve(RequestContext& machine, const SharedCall& call) const;

 private:
  void refuseUnlessUndisturbed(RequestContext& machine) const;
  void refuseUnlessApart(RequestContext& machine) const;
};

}  // namespace stepdriver::machine
