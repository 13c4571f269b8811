#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "profile/profile_sum.h"
#include "profile/step_finder.h"
#include "timeline/compare_track.h"
#include "timeline/successors.h"

namespace stepdriver::pulse {

/// What an output does next because of the position of an axis, and when. It follows the profiles
/// of the axis like the motor, but only the steps with which the joint passes an edge of its track
/// count. All times are motion times. For the pulse thread.
///
/// An action may come earlier than its edge by a lead. It comes once a passage: if another profile
/// takes over before the edge, the passage has another time, and if the axis then turns back or
/// comes to rest, the action is undone.
class CompareFollower {
 public:
  /// @name Its track
  /// @{

  /// @param track outlives the following. @param joint [microsteps] where the joint rests.
  void begin(const CompareTrack& track, double joint);
  void clear();
  const CompareTrack* track() const { return track_; }
  /// Whether its output is on where the joint is, see CompareTrack::by_place.
  bool isOnHere() const;
  /// @}

  /// @name Profiles of the axis
  /// @{

  /// @param joint [microsteps] where it rests, if this profile begins from rest.
  void follow(const Successors::Entry& entry, double joint);
  bool follows() const { return static_cast<bool>(profile_); }
  bool hasRoom(Nanoseconds start) const { return successors_.hasRoom(start); }
  /// The motion has ended. @param joint [microsteps] where the joint is by the steps that were made
  void end(Nanoseconds motion_now, double joint);
  /// @}

  /// @name The next action
  /// @{

  /// Motion time at which advance() must be called; empty: at none, as it is planned.
  std::optional<Nanoseconds> due() const;
  /// What to do then; kNothing: only to advance.
  CompareAction action() const;
  /// It is done, or is given up.
  void advance();
  /// What the last action must be followed by, because its edge wasn't passed; kNothing if it was.
  CompareAction takeUndone();
  /// @}

 private:
  // The joint passes an edge.
  struct Passage {
    Nanoseconds time = 0;
    std::size_t edge = 0;
    bool up = false;
    CompareAction action = CompareAction::kNothing;
    std::size_t above() const { return up ? edge + 1 : edge; }
  };
  // More passages without an action than these aren't looked at ahead of time.
  static constexpr std::size_t kMostIdle = 8;

  std::size_t searchedFrom() const { return idle_ == 0 ? below_ : idles_[idle_ - 1].above(); }
  std::int64_t lowCount(std::size_t below) const;
  std::int64_t highCount(std::size_t below) const;
  std::size_t belowAt(double joint) const;
  bool isBetween(std::size_t below, double joint) const;
  Nanoseconds lead(CompareAction action) const;
  void adopt(const Successors::Entry& entry);
  void takeOver();
  void find();
  void replan();
  void undo(CompareAction action);

  const CompareTrack* track_ = nullptr;
  std::size_t below_ = 0;  // edges below the joint, before the passages without an action
  std::array<Passage, kMostIdle> idles_{};
  std::size_t idle_ = 0;
  std::optional<Passage> next_;
  bool made_ = false;  // the next one's action, by its lead
  CompareAction undone_ = CompareAction::kNothing;
  motion::ShapedProfile profile_;
  motion::StepFinder finder_;
  motion::ProfileSum parts_;  // of a profile that is shaped
  Successors successors_;
  Nanoseconds replaced_at_ = kNever;
};

}  // namespace stepdriver::pulse
