#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "input_shaper.h"
#include "profile.h"

namespace stepdriver::motion {

/// A motion as it is made: a profile as it is, or the sum of its delayed parts (InputShaper). It
/// refers to the profile and the shaper, which outlive it; copying it costs nothing.
///
/// The sum of cubic pieces is cubic pieces again, from each break of a part to the next one. They
/// are computed on demand, by a ProfileSum: any profile can be shaped without going through it.
class ShapedProfile {
 public:
  /// A motion that makes no step.
  ShapedProfile() = default;
  /// A profile that is made as it is.
  ShapedProfile(const Profile* profile)  // NOLINT: a profile is one of these
      : profile_(profile), start_ns_(profile != nullptr ? profile->startNs() : 0) {}
  /// @param profile the profile, with everything before the start that the parts still have to make
  ShapedProfile(const Profile& profile, const InputShaper& shaper, std::int64_t start_ns)
      : profile_(&profile), shaper_(&shaper), start_ns_(start_ns) {}

  explicit operator bool() const { return profile_ != nullptr; }

  /// @name The same as of a profile
  /// @{
  std::int64_t startNs() const { return start_ns_; }
  std::int64_t endNs() const;
  DoubleDouble endPosition() const { return profile_->endPosition(); }
  double peakSpeed() const { return profile_->peakSpeed(); }
  /// Before the start, the motion before it counts.
  MotionState stateAt(std::int64_t time_ns) const;
  /// @}

  const Profile& profile() const { return *profile_; }
  /// nullptr: the profile is made as it is.
  const InputShaper* shaper() const { return shaper_; }

 private:
  const Profile* profile_ = nullptr;
  const InputShaper* shaper_ = nullptr;
  std::int64_t start_ns_ = 0;
};

/// A plan with everything that is needed to make it. Immutable, and cheap to copy.
class PlannedMotion {
 public:
  PlannedMotion() = default;
  /// A plan from rest, or one that isn't shaped.
  /// @param shaper nullptr: it is made as it is
  PlannedMotion(std::shared_ptr<const Profile> plan, std::shared_ptr<const InputShaper> shaper)
      : plan_(std::move(plan)), profile_(plan_), shaper_(std::move(shaper)) {}

  /// A plan that takes over from this one at its start: its parts begin while those of this one are
  /// still to be made.
  PlannedMotion takenOverBy(std::shared_ptr<const Profile> plan) const;

  /// The plan, from its own start on: where the motion would be without a shaper.
  const std::shared_ptr<const Profile>& plan() const { return plan_; }
  /// The motion as it is made. This must outlive it.
  ShapedProfile made() const {
    if (shaper_ == nullptr) return profile_.get();
    return {*profile_, *shaper_, plan_->startNs()};
  }

 private:
  std::shared_ptr<const Profile> plan_;
  std::shared_ptr<const Profile> profile_;  // the same profile with what comes before it
  std::shared_ptr<const InputShaper> shaper_;
};

}  // namespace stepdriver::motion
