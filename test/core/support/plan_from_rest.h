#pragma once

#include <cstdint>

#include "point_to_point/planner.h"

namespace stepdriver::motion {

/// The fastest motion from rest to rest.
inline Profile planFromRest(std::int64_t start_ns, std::int64_t from, std::int64_t to,
                            const MotionLimits& limits) {
  return planMove(start_ns, {fromInteger(from), 0.0, 0.0}, to, limits).profile;
}

}  // namespace stepdriver::motion
