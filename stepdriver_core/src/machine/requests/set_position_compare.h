#pragma once

#include <optional>
#include <string>

#include "request_context.h"
#include "stepdriver_core/config/io_config.h"

namespace stepdriver::machine {

/// Machine::setPositionCompare() and Machine::clearPositionCompare()
struct SetPositionCompare {
  std::string output;
  std::optional<config::PositionCompare> compare;

  static constexpr bool kReadsInputs = false;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
