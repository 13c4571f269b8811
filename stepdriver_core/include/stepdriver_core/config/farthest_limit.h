#pragma once

namespace stepdriver::config {

/// [steps] The farthest soft limit that an axis may have, from any source: 2^53, because doubles
/// represent each step up to there exactly.
constexpr double kFarthestLimit = 9007199254740992.0;

}  // namespace stepdriver::config
