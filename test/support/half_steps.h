#pragma once

#include <algorithm>
#include <array>
#include <optional>

// How the tests read the coils of a motor of phases: from a table of their own.

namespace stepdriver::test {

/// Which of IN1 to IN4 are on.
using Coils = std::array<bool, 4>;

/// @return the half step, of the eight of a cycle, that these coils make; empty: none.
inline std::optional<int> halfStepOf(const Coils& coils) {
  static constexpr std::array<Coils, 8> kHalfSteps = {{{true, true, false, false},
                                                       {false, true, false, false},
                                                       {false, true, true, false},
                                                       {false, false, true, false},
                                                       {false, false, true, true},
                                                       {false, false, false, true},
                                                       {true, false, false, true},
                                                       {true, false, false, false}}};
  const auto* found = std::find(kHalfSteps.begin(), kHalfSteps.end(), coils);
  if (found == kHalfSteps.end()) return {};
  return static_cast<int>(found - kHalfSteps.begin());
}

/// [half steps] The shorter way from one to another, of -4 to 3.
inline int wayBetween(int from, int to) { return (to - from + 12) % 8 - 4; }

}  // namespace stepdriver::test
