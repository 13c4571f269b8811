#pragma once

#include <cstdint>

#include "sim_time.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {

/// The brake of an axis. When its line engages it, it grips at once, but holds the load only after
/// its engage time. When its line releases it, it lets the load go at once, but drags until its
/// release time is over. An order of writes that relies on it too early shows in both cases.
class BrakeModel {
 public:
  explicit BrakeModel(const BrakeSpec& spec) : spec_(spec), level_(!spec.release_level) {}

  const BrakeSpec& spec() const { return spec_; }
  bool lineLevel() const { return level_; }
  bool isReleased() const { return level_ == spec_.release_level; }

  /// The line has this level from now on. Before the first request, it engages the brake.
  void set(bool level, std::int64_t time_ns) {
    if (level == level_) return;
    level_ = level;
    changed_ns_ = time_ns;
  }

  /// The time from which it holds the load; kNever if it is released.
  std::int64_t holdsFrom() const {
    if (isReleased()) return kNever;
    return changed_ns_ == kForEver ? kForEver : changed_ns_ + spec_.engage_ns;
  }
  /// Whether a motor would turn against it.
  bool drags(std::int64_t time_ns) const {
    return !isReleased() || time_ns - changed_ns_ < spec_.release_ns;
  }

 private:
  const BrakeSpec spec_;
  bool level_;
  std::int64_t changed_ns_ = kForEver;
};

}  // namespace stepdriver::sim
