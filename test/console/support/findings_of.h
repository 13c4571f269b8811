#pragma once

#include <string>

#include "wizard/findings.h"

namespace stepdriver::console {

inline Findings findingsOf(const std::string& axis) {
  Findings findings;
  findings.axis = axis;
  return findings;
}

}  // namespace stepdriver::console
