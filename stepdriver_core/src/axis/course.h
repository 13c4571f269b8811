#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "axis_impl.h"
#include "stepdriver_core/motion/profile.h"

namespace stepdriver::axis {

/// The way of several axes that move as one: where each of them is at each place of a path. How
/// the path is run through is one profile for all, so that they stay on it whatever happens:
/// another speed, a stop, a hold.
class Course {
 public:
  /// @param axes at least one.
  explicit Course(std::vector<Axis::Impl*> axes)
      : axes_(std::move(axes)), group_(axes_.front()->driver.newGroup()) {}
  virtual ~Course() = default;
  Course(const Course&) = delete;
  Course& operator=(const Course&) = delete;

  const std::vector<Axis::Impl*>& axes() const { return axes_; }
  /// Of the engine.
  std::uint64_t group() const { return group_; }

  /// Takes the axes over from what they do at a motion time. May be called again, for a later one,
  /// as long as no plan for it has been taken.
  virtual void start(std::int64_t at) = 0;
  /// Where the path begins.
  virtual motion::MotionState begin() const = 0;
  /// Along the path to its end.
  virtual motion::Profile plan(std::int64_t at, const motion::MotionState& from,
                               double speed_override) const = 0;
  /// Along the path to rest.
  virtual motion::Profile planStop(std::int64_t at, const motion::MotionState& from) const = 0;
  /// What one of the axes does while the path is run through [microsteps].
  virtual motion::Profile profileOf(std::size_t member, const motion::Profile& path) const = 0;

 private:
  std::vector<Axis::Impl*> axes_;
  std::uint64_t group_;
};

}  // namespace stepdriver::axis
