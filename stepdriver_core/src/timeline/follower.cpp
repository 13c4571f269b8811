#include "timeline/follower.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stepdriver::pulse {

void Follower::advance() {
  stepped_ = next_->direction;
  count_ += stepped_;
  since_ = next_->time_ns;
  running_ = true;
  pullNext();
}

void Follower::pullNext() {
  motion::Step step;
  next_.reset();
  if (finder_.next(step)) next_ = step;
}

Nanoseconds Follower::madeUntil() const {
  return follows() ? since_ : std::numeric_limits<Nanoseconds>::min();
}

void Follower::follow(const Successors::Entry& entry, const Pace& pace) {
  pace_ = pace;
  follows() ? append(entry) : begin(entry);
}

void Follower::adopt(const Successors::Entry& entry) {
  profile_ = entry.profile;
  following_ = entry.serial;
  settles_ = entry.settles;
}

void Follower::seed() {
  if (profile_.shaper() == nullptr) {
    finder_ = motion::StepFinder(profile_.profile(), count_);
  } else {
    parts_.begin(profile_.startNs());
    parts_.add(1.0, profile_);
    finder_ = motion::StepFinder(parts_, count_);
  }
  pullNext();
}

void Follower::begin(const Successors::Entry& entry) {
  adopt(entry);
  seed();
  since_ = entry.profile.startNs();
  running_ = false;
}

void Follower::append(const Successors::Entry& entry) {
  successors_.add(entry);
  replaced_at_ = successors_.first().profile.startNs();
}

bool Follower::takeOver() {
  adopt(successors_.takeFirst());
  seed();
  replaced_at_ = successors_.empty() ? kNever : successors_.first().profile.startNs();
  return true;
}

std::optional<Nanoseconds> Follower::endsAt() const { return profile_.endNs(); }

void Follower::end() {
  following_ = 0;
  profile_ = {};
  successors_.clear();
  replaced_at_ = kNever;
  next_.reset();
}

bool Follower::isFast(Nanoseconds /*motion_now*/) const { return nextIsFast(); }

double Follower::velocityAt(Nanoseconds motion_time) const {
  return profile_.stateAt(motion_time).velocity;
}

int Follower::directionAt(Nanoseconds /*step*/) const { return next_->direction; }

// A step's interval alone would be too long in a motion that speeds up, and the present speed alone
// in one that slows down.
Nanoseconds Follower::angleAsTime(Nanoseconds motion_now) const {
  const double speed = std::abs(velocityAt(motion_now));
  const auto interval_ns = static_cast<double>(interval());
  const double step_ns = speed * interval_ns > 1e9 ? 1e9 / speed : interval_ns;
  const double angle_ns = pace_.late * step_ns;
  return angle_ns < kLongestCatchUp ? static_cast<Nanoseconds>(angle_ns) : kLongestCatchUp;
}

Nanoseconds Follower::absorbed(Nanoseconds motion_now) const {
  const auto part = static_cast<Nanoseconds>((1.0 - kClosest) * static_cast<double>(interval()));
  return catchesUp() ? std::max(part, angleAsTime(motion_now)) : part;
}

}  // namespace stepdriver::pulse
