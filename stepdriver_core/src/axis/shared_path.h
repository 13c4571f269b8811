#pragma once

#include <cstddef>
#include <cstdint>

#include "motion/profile.h"

namespace stepdriver::axis {

/// Where each of several axes is at each place of a path. How the path is run through is one
/// profile for all of them, so that they stay on it whatever happens: another speed, a stop, a
/// hold.
///
/// Never changed once made, and without an axis, an engine or a clock: any thread may plan on it.
/// Every function takes a bounded time, however long the path is. None throws but std::range_error,
/// if a motion would take longer than motion::Profile::kLongest.
class SharedPath {
 public:
  SharedPath() = default;
  virtual ~SharedPath() = default;
  SharedPath(const SharedPath&) = delete;
  SharedPath& operator=(const SharedPath&) = delete;

  /// Where the path begins, and at which rate.
  virtual motion::MotionState begin() const = 0;
  /// Along the path to its end, from a place on it.
  virtual motion::Profile plan(std::int64_t at, const motion::MotionState& from,
                               double speed_override) const = 0;
  /// Along the path to rest.
  virtual motion::Profile planStop(std::int64_t at, const motion::MotionState& from) const = 0;
  /// What the motor of one of the axes does while the path is run through [microsteps].
  virtual motion::Profile profileOf(std::size_t member, const motion::Profile& path) const = 0;
};

}  // namespace stepdriver::axis
