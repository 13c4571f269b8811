#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

#include "profile/shaped_profile.h"

namespace stepdriver::motor {

/// Where a motor was in the last seconds, by the motions that the engine has followed: an edge of
/// an input is reported after its time, and counts when it has stayed. It is kept only while
/// somebody watches.
class MotionHistory {
 public:
  /// A part of the past, until the next one begins.
  struct Part {
    std::int64_t from = 0;         ///< motion time
    bool moved = false;            ///< otherwise it was at rest
    motion::PlannedMotion motion;  ///< if it moved
    double place = 0.0;            ///< [microsteps] of the motor, at rest
    double slack = 0.0;            ///< [microsteps] the part of the backlash that was taken up
  };

  bool isKept() const { return watchers_ != 0; }
  /// Somebody begins to watch. @param now what is known of the present.
  void watch(Part now) {
    if (watchers_++ == 0) parts_ = {std::move(now)};
  }
  void unwatch() {
    if (--watchers_ == 0) parts_.clear();
  }
  /// Something else begins.
  void add(Part part) {
    parts_.push_back(std::move(part));
    while (parts_.size() > kMostParts || parts_.at(1).from < parts_.back().from - kKept) {
      parts_.pop_front();
    }
  }
  /// The part at a motion time; before all parts it is the first one. @pre isKept()
  const Part& at(std::int64_t time) const {
    auto part = parts_.rbegin();
    while (part->from > time && std::next(part) != parts_.rend()) ++part;
    return *part;
  }

 private:
  // The longest debounce time of an input, and as much again for the delay of its report.
  static constexpr std::int64_t kKept = 2'000'000'000;
  static constexpr std::size_t kMostParts = 256;

  std::size_t watchers_ = 0;
  std::deque<Part> parts_;
};

}  // namespace stepdriver::motor
