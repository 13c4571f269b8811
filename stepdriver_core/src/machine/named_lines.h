#pragma once

#include "named_inputs.h"
#include "named_outputs.h"

namespace stepdriver::machine {

/// The lines with a name.
struct NamedLines {
  NamedOutputs outputs;
  NamedInputs inputs;

  IoStates states() const { return {outputs.states(), inputs.states()}; }
};

}  // namespace stepdriver::machine
