#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "channel/channel_state.h"
#include "point_to_point/motion_limits.h"
#include "profile/shaped_profile.h"

namespace stepdriver::motor {

/// A profile that was ordered from the pulse engine.
struct Motion {
  static constexpr std::int64_t kNeverSlows = std::numeric_limits<std::int64_t>::max();

  std::uint64_t serial = 0;
  /// [microsteps of the joint] Of a move; empty: it has no end.
  std::optional<std::int64_t> target;
  bool slows_down = false;  ///< it only comes to rest, at any position
  /// Those that it was planned with, or that the motion was planned with that it slows down. Their
  /// max_speed doesn't count.
  motion::MotionLimits limits;
  /// Motion time from which its jerk may be that of stops.
  std::int64_t slows_ns = kNeverSlows;
  double overshoot = 0.0;  ///< [microsteps] how far it overshoots its end before it comes back
  motion::PlannedMotion planned;
  /// The data that the engine reads until it has handled the order.
  std::shared_ptr<const void> order;
};

/// The profiles of one channel that the engine may still read: from the one that it follows, or
/// that ended last, to the one that was ordered last. Owns them until the engine no longer uses
/// them.
class Motions {
 public:
  void add(Motion motion) { motions_.push_back(std::move(motion)); }

  /// Drops the motions that the engine has refused, and those older than the profile that it
  /// follows or that ended last.
  void update(const pulse::ChannelState& state);

  /// The engine follows a profile, or has not yet answered an order.
  bool moving() const { return following_ != 0 || inFlight(); }
  bool inFlight() const { return !motions_.empty() && motions_.back().serial > taken_; }

  /// The one that was ordered last; nullptr at rest.
  const Motion* latest() const {
    return moving() && !motions_.empty() ? &motions_.back() : nullptr;
  }
  /// @return nullptr if there is none with this serial.
  const Motion* find(std::uint64_t serial) const;

  /// From the one that the engine follows, or the one that ended last, on.
  const std::deque<Motion>& all() const { return motions_; }

 private:
  std::deque<Motion> motions_;
  std::uint64_t following_ = 0;
  std::uint64_t taken_ = 0;
};

}  // namespace stepdriver::motor
