#include "timeline/compare_follower.h"

#include <algorithm>
#include <utility>

#include "profile/resting_count.h"

namespace stepdriver::pulse {
namespace {

// Beyond each count.
constexpr std::int64_t kNowhere = std::int64_t{1} << 60;

// [microsteps] An axis that shares motors may rest exactly on an edge. The solver has decided
// whether it was passed; a rounding of the place must not decide that again.
constexpr double kOnEdge = 1e-6;

}  // namespace

// ---- its track ----

void CompareFollower::begin(const CompareTrack& track, double joint) {
  clear();
  track_ = &track;
  below_ = belowAt(joint);
}

void CompareFollower::clear() {
  track_ = nullptr;
  profile_ = {};
  successors_.clear();
  replaced_at_ = kNever;
  next_.reset();
  idle_ = 0;
  made_ = false;
  undone_ = CompareAction::kNothing;
}

bool CompareFollower::isOnHere() const {
  return track_->by_place && below_ > 0 && track_->edges[below_ - 1].up == CompareAction::kOn;
}

std::size_t CompareFollower::belowAt(double joint) const {
  const auto& edges = track_->edges;
  const std::int64_t count = motion::restingCount(joint);
  const auto above =
      std::upper_bound(edges.begin(), edges.end(), count,
                       [](std::int64_t at, const CompareEdge& edge) { return at < edge.at; });
  return static_cast<std::size_t>(above - edges.begin());
}

bool CompareFollower::isBetween(std::size_t below, double joint) const {
  const auto& edges = track_->edges;
  const auto place = [&](std::size_t edge) { return static_cast<double>(edges[edge].at) - 0.5; };
  return (below == 0 || joint > place(below - 1) - kOnEdge) &&
         (below == edges.size() || joint < place(below) + kOnEdge);
}

// The count of the motor when the joint passes the next edge below.
std::int64_t CompareFollower::lowCount(std::size_t below) const {
  return below == 0 ? -kNowhere : track_->edges[below - 1].at - 1;
}

std::int64_t CompareFollower::highCount(std::size_t below) const {
  if (below == track_->edges.size()) return kNowhere;
  return track_->edges[below].at + track_->backlash;
}

Nanoseconds CompareFollower::lead(CompareAction action) const {
  switch (action) {
    case CompareAction::kNothing:
      return 0;
    case CompareAction::kOff:
      return track_->lead_off;
    default:
      return track_->lead_on;
  }
}

// ---- profiles ----

void CompareFollower::follow(const Successors::Entry& entry, double joint) {
  if (!follows()) {
    if (!isBetween(below_, joint)) below_ = belowAt(joint);
    adopt(entry);
    return find();
  }
  successors_.add(entry);
  replaced_at_ = successors_.first().profile.startNs();
  if (!next_ || next_->time >= replaced_at_) replan();
}

// The next passage has another time, or doesn't come.
void CompareFollower::replan() {
  const std::optional<Passage> planned = std::exchange(next_, std::nullopt);
  takeOver();
  find();
  if (!made_ || (next_ && next_->edge == planned->edge && next_->up == planned->up)) return;
  made_ = false;
  undo(planned->action);
}

void CompareFollower::undo(CompareAction action) {
  if (action == CompareAction::kOn) undone_ = CompareAction::kOff;
  if (action == CompareAction::kOff) undone_ = CompareAction::kOn;
}

void CompareFollower::takeOver() {
  const Successors::Entry entry = successors_.takeFirst();
  while (idle_ > 0 && idles_[idle_ - 1].time >= entry.profile.startNs()) --idle_;
  adopt(entry);
}

// Roundings of the place at which it takes over don't pass an edge.
void CompareFollower::adopt(const Successors::Entry& entry) {
  profile_ = entry.profile;
  replaced_at_ = successors_.empty() ? kNever : successors_.first().profile.startNs();
  const std::size_t below = searchedFrom();
  const std::int64_t place =
      motion::restingCount(profile_.stateAt(profile_.startNs()).position.value());
  const std::int64_t count = std::clamp(place, lowCount(below) + 1, highCount(below) - 1);
  if (profile_.shaper() == nullptr) {
    finder_ = motion::StepFinder(profile_.profile(), count);
  } else {
    parts_.begin(profile_.startNs());
    parts_.add(1.0, profile_);
    finder_ = motion::StepFinder(parts_, count);
  }
}

void CompareFollower::find() {
  while (!next_) {
    const std::size_t below = searchedFrom();
    motion::Step step;
    const bool found = finder_.nextTo(lowCount(below), highCount(below), step);
    if (!found || step.time_ns >= replaced_at_) {
      if (successors_.empty()) return;
      takeOver();
      continue;
    }
    Passage passage;
    passage.time = step.time_ns;
    passage.up = step.direction > 0;
    passage.edge = passage.up ? below : below - 1;
    const CompareEdge& edge = track_->edges[passage.edge];
    passage.action = passage.up ? edge.up : edge.down;
    if (passage.action == CompareAction::kNothing && idle_ < kMostIdle) {
      idles_[idle_++] = passage;
    } else {
      next_ = passage;
    }
  }
}

void CompareFollower::end(Nanoseconds motion_now, double joint) {
  for (std::size_t i = 0; i < idle_ && idles_[i].time <= motion_now; ++i) {
    below_ = idles_[i].above();
  }
  idle_ = 0;
  const std::optional<Passage> last = std::exchange(next_, std::nullopt);
  const bool passed = last && last->time <= motion_now && isBetween(last->above(), joint);
  if (passed) below_ = last->above();
  // An action that has waited for the least times of its output comes now.
  if (passed && !made_ && last->action != CompareAction::kPulse) undone_ = last->action;
  if (!passed && std::exchange(made_, false)) undo(last->action);
  made_ = false;
  profile_ = {};
  successors_.clear();
  replaced_at_ = kNever;
}

// ---- the next action ----

std::optional<Nanoseconds> CompareFollower::due() const {
  if (!next_) return std::nullopt;
  return made_ ? next_->time : next_->time - lead(next_->action);
}

CompareAction CompareFollower::action() const {
  return made_ || !next_ ? CompareAction::kNothing : next_->action;
}

void CompareFollower::advance() {
  if (!made_ && lead(next_->action) > 0) {
    made_ = true;
    return;
  }
  made_ = false;
  below_ = next_->above();
  idle_ = 0;
  next_.reset();
  find();
}

CompareAction CompareFollower::takeUndone() {
  return std::exchange(undone_, CompareAction::kNothing);
}

}  // namespace stepdriver::pulse
