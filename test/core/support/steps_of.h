#pragma once

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "profile/profile.h"
#include "profile/step_finder.h"

namespace stepdriver::motion {

/// @return the times [ns] and directions of all steps of a profile.
inline std::vector<std::pair<std::int64_t, int>> stepsOf(const Profile& profile) {
  const DoubleDouble start = profile.stateAt(profile.startNs()).position;
  StepFinder finder(profile, std::llround(start.value()));
  std::vector<std::pair<std::int64_t, int>> steps;
  for (Step step; finder.next(step);) steps.emplace_back(step.time_ns, step.direction);
  return steps;
}

}  // namespace stepdriver::motion
