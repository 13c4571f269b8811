#pragma once

#include <cstdint>
#include <vector>

#include "profile.h"
#include "shaped_profile.h"

namespace stepdriver::motion {

/// The motion of an axis along a path, to find when it is at a place.
struct ShapedAxis {
  PlannedMotion motion;
  double unit = 1.0;  ///< [unit/microstep] so that places of several axes can be compared
};

/// The axes of a path, of which one has an input shaper: they are at a place later than planned.
class ShapedAxes {
 public:
  ShapedAxes(std::vector<ShapedAxis> axes, std::int64_t start_ns);

  /// Motion time from which on these motions are made.
  std::int64_t startNs() const { return start_ns_; }
  /// By how much the axes are later at most.
  std::int64_t longestDelayNs() const { return longest_ns_; }

  /// A place at which the axes are planned to be at a time, and their direction there.
  ///
  /// @pre The place is one of the motions from startNs() on.
  class Place {
   public:
    Place(const ShapedAxes& axes, std::int64_t planned_ns);

    /// How far the axes are beyond the place as they are made, in the direction that the path has
    /// there. Both are in units that are the same for all times.
    struct Way {
      double beyond = 0.0;
      double speed = 0.0;
    };
    /// @param made the motions that are made then: these, or others that have taken over from them.
    Way wayAt(const ShapedAxes& made, std::int64_t time_ns) const;

   private:
    const ShapedAxes& axes_;
    std::int64_t planned_ns_;
    std::int64_t from_ns_;
    std::int64_t to_ns_;
  };

 private:
  std::vector<ShapedAxis> axes_;
  std::int64_t start_ns_;
  std::int64_t longest_ns_ = 0;
};

}  // namespace stepdriver::motion
