#include "activities.h"

#include <algorithm>
#include <map>
#include <utility>

#include "come_to_rest.h"

namespace stepdriver::activity {
namespace {

bool has(const std::vector<axis::AxisModel*>& axes, const axis::AxisModel* axis) {
  return std::find(axes.begin(), axes.end(), axis) != axes.end();
}

}  // namespace

Activity* Activities::find(const axis::AxisModel& axis, bool begun) const {
  const auto found = std::find_if(all_.begin(), all_.end(), [&](const auto& activity) {
    return activity->hasBegun() == begun && !activity->isFinished() && has(activity->axes(), &axis);
  });
  return found != all_.end() ? found->get() : nullptr;
}

void Activities::begin(std::unique_ptr<Activity> activity, const Why& why) {
  bool at_speed = activity->handover() == Activity::Handover::kAtSpeed;
  for (axis::AxisModel* axis : activity->axes()) {
    const Activity* now = owner(*axis);
    at_speed = at_speed && (now == nullptr || now->canHandOver());
  }
  if (at_speed) activity->prepare();
  for (axis::AxisModel* axis : activity->axes()) {
    if (Activity* next = heir(*axis)) next->end(why);
  }
  if (at_speed) return takeOver(std::move(activity));
  for (axis::AxisModel* axis : activity->axes()) {
    Activity* now = owner(*axis);
    if (now != nullptr && !now->isInBackground()) now->end(why);
  }
  all_.push_back(std::move(activity));
}

void Activities::takeOver(std::unique_ptr<Activity> activity) {
  std::vector<Predecessor> predecessors;
  // By axis. An axis has several goals if the engine has not yet accepted the last one.
  std::map<const axis::AxisModel*, std::vector<Predecessor>> companions;
  for (axis::AxisModel* axis : activity->axes()) {
    Activity* now = owner(*axis);
    if (now == nullptr) continue;
    for (Predecessor& left : now->handOver("another command took over")) {
      auto& goals = has(activity->axes(), left.axis) ? predecessors : companions[left.axis];
      goals.push_back(std::move(left));
    }
  }
  Activity& begun = *activity;
  all_.push_back(std::move(activity));
  begun.begin(std::move(predecessors));
  beginParts(begun);
  // An axis that was given another goal has left its path, and the others can't continue without
  // it.
  const std::string left_by = begun.axes().front()->name();
  for (const auto& axis : context_.axes) {
    const auto goals = companions.find(axis.get());
    if (goals == companions.end()) continue;
    all_.push_back(std::make_unique<ComeToRest>(
        context_, std::move(goals->second),
        Why{axis::MoveEnd::kStopped,
            left_by + ", which it moved together with, was given another goal"}));
    all_.back()->begin({});
  }
}

void Activities::end(const axis::AxisModel& axis, const Why& why, const Ack& call) {
  if (Activity* next = heir(axis)) next->end(why);
  if (Activity* now = owner(axis)) now->end(why, call);
}

void Activities::endAll(const Why& why, const Ack& call) {
  for (const auto& axis : context_.axes) end(*axis, why, call);
}

void Activities::look() {
  // Activities that begin during the loop are included.
  for (std::size_t i = 0; i < all_.size(); ++i) all_[i]->look();
  while (sweep()) {
  }
}

bool Activities::mayBegin(const Activity& activity) const {
  return std::all_of(activity.axes().begin(), activity.axes().end(),
                     [this](const axis::AxisModel* axis) { return owner(*axis) == nullptr; });
}

void Activities::beginParts(Activity& of) {
  for (Activity::Part& part : of.takeParts()) {
    all_.push_back(std::move(part.activity));
    all_.back()->begin(std::move(part.predecessors));
  }
}

bool Activities::sweep() {
  for (std::size_t i = 0; i < all_.size(); ++i) {
    if (all_[i]->isFinished()) beginParts(*all_[i]);
  }
  all_.erase(std::remove_if(all_.begin(), all_.end(),
                            [](const auto& activity) { return activity->isFinished(); }),
             all_.end());
  for (std::size_t i = 0; i < all_.size(); ++i) {
    Activity& next = *all_[i];
    if (next.hasBegun() || !mayBegin(next)) continue;
    next.begin({});
    next.look();
    return true;
  }
  return std::any_of(all_.begin(), all_.end(),
                     [](const auto& activity) { return activity->isFinished(); });
}

void Activities::forEach(const std::function<void(Activity&)>& action) const {
  for (std::size_t i = 0; i < all_.size(); ++i) action(*all_[i]);
}

pulse::Nanoseconds Activities::due() const {
  pulse::Nanoseconds due = pulse::kNever;
  for (const auto& activity : all_) {
    if (activity->hasBegun()) due = std::min(due, activity->due());
  }
  return due;
}

bool Activities::watchInputs() const {
  return std::any_of(all_.begin(), all_.end(),
                     [](const auto& activity) { return activity->watchesInputs(); });
}

}  // namespace stepdriver::activity
