#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "profile/marks.h"
#include "profile/profile.h"

namespace stepdriver::motion {

/// A path of several axes: the position of each axis for each position along the path. One profile
/// describes the motion along the path for all of them, so that they stay on it at any speed and
/// during a stop or a hold.
///
/// It is immutable, and uses no axis, engine or clock: any thread may plan on it. Every function
/// takes a bounded time, however long the path is. The only exception is motion::TooLong, if a
/// motion would take longer than motion::Profile::kLongest.
class SharedPath {
 public:
  SharedPath() = default;
  virtual ~SharedPath() = default;
  SharedPath(const SharedPath&) = delete;
  SharedPath& operator=(const SharedPath&) = delete;

  /// The position and the rate at the beginning of the path.
  virtual MotionState begin() const = 0;
  /// The state in which a motion continues from rest at a position on the path.
  virtual MotionState restart(DoubleDouble position) const { return {position, 0.0, 0.0}; }
  /// Whether the axes wait at its end for another path that continues it.
  virtual bool waitsAtEnd() const { return false; }
  /// Where outputs are switched along it; nullptr: nowhere. Only a path whose positions are its own
  /// times at full rate has marks.
  virtual std::shared_ptr<const PathMarks> marks() const { return nullptr; }
  /// The motion along the path to its end, from a position on it.
  virtual Profile plan(std::int64_t at, const MotionState& from, double speed_override) const = 0;
  /// The motion along the path to rest.
  virtual Profile planStop(std::int64_t at, const MotionState& from) const = 0;
  /// The motion of one axis's motor along the path [microsteps].
  virtual Profile profileOf(std::size_t member, const Profile& path) const = 0;
};

}  // namespace stepdriver::motion
