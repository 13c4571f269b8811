#pragma once

#include <string>

#include "request_context.h"

namespace stepdriver::machine {

/// Machine::setOutput()
struct SetOutput {
  std::string name;
  bool on = false;
  double value = 1.0;  // see Machine::setOutput()

  static constexpr bool kReadsInputs = true;
  std::string text(const AxisWords& axes) const;
  void serve(RequestContext& machine, const SharedCall& call) const;
};

}  // namespace stepdriver::machine
