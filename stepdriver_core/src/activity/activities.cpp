#include "activities.h"

#include <algorithm>
#include <map>
#include <utility>

#include "come_to_rest.h"
#include "driver_activities.h"
#include "stepdriver_core/error.h"

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

void Activities::begin(std::unique_ptr<Activity> activity, const EarlyEnd& why) {
  bool at_speed = activity->handover() == Activity::Handover::kAtSpeed;
  for (axis::AxisModel* axis : activity->axes()) {
    const Activity* now = owner(*axis);
    at_speed = at_speed && (now == nullptr || now->canHandOver());
  }
  if (at_speed) activity->prepare();
  if (!activity->isInBackground() && !activity->followsSetpoints()) {
    for (axis::AxisModel* axis : activity->axes()) axis->setpoints.end();
  }
  if (!activity->leavesLaterMotions()) {
    for (const axis::AxisModel* axis : activity->axes()) schedule_.drop(*axis, why);
  }
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
  // For each axis. It has several goals if the engine has not yet accepted the last one.
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
        EarlyEnd{axis::MoveEnd::kStopped,
                 left_by + ", which it moved together with, was given another goal"}));
    all_.back()->begin({});
  }
}

void Activities::end(const axis::AxisModel& axis, const EarlyEnd& why, const SharedCall& call) {
  schedule_.drop(axis, why);
  if (Activity* next = heir(axis)) next->end(why);
  if (Activity* now = owner(axis)) now->end(why, call);
}

void Activities::endAll(const EarlyEnd& why, const SharedCall& call) {
  for (const auto& axis : context_.axes) end(*axis, why, call);
}

void Activities::poll() {
  // Activities that begin during the loop are included.
  for (std::size_t i = 0; i < all_.size(); ++i) all_[i]->poll();
  while (sweep()) {
  }
  lookAtSchedule();
}

void Activities::refuseWhileSharersAreBusy(const axis::AxisModel& axis) const {
  for (const axis::AxisModel* sharer : axis.sharers()) {
    for (const Activity* busy : {owner(*sharer), heir(*sharer)}) {
      if (busy == nullptr) continue;
      const bool homes = busy->homingPhase() != axis::HomingPhase::kNone;
      if (!homes && busy->work() == Activity::Work::kMoves) continue;
      axis.refuse("busy: " + sharer->name() + ", which shares its motors, " +
                  (homes ? "is being homed" : "has its driver's pins written"));
    }
  }
}

// ---- motions that begin later ----

bool Activities::mayBeTakenOver(const axis::AxisModel& axis) const {
  const Activity* now = owner(axis);
  return heir(axis) == nullptr && (now == nullptr || now->canHandOver());
}

std::vector<axis::Move> Activities::beginLater(LaterMotion motion) {
  for (const Order& order : motion.orders) {
    const Activity* now = owner(*order.axis);
    if (mayBeTakenOver(*order.axis) || (now != nullptr && now->isInBackground())) continue;
    order.axis->refuse(
        now != nullptr && now->homingPhase() != axis::HomingPhase::kNone
            ? "busy: it is being homed; a trajectory that begins later is accepted after that"
            : "busy: it is about to move; a trajectory that begins later is accepted when it moves "
              "or is at rest");
  }
  return schedule_.add(std::move(motion));
}

void Activities::lookAtSchedule() {
  schedule_.poll();
  for (axis::AxisModel* axis : schedule_.toWake()) {
    if (isFree(*axis)) begin(std::make_unique<WakeUp>(context_, *axis, nullptr), {});
  }
  while (std::optional<Schedule::Due> due = schedule_.takeDue()) {
    try {
      for (const axis::AxisModel* axis : due->activity->axes()) {
        axis->refuseUnlessReady();
        refuseWhileSharersAreBusy(*axis);
        if (!mayBeTakenOver(*axis) || axis->mustWake()) {
          axis->refuse("busy: its driver's pins are being written");
        }
      }
      begin(std::move(due->activity), {axis::MoveEnd::kReplaced, "another command took over"});
    } catch (const Error& error) {
      due->call->fail(failureOf(error));
    }
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
    next.poll();
    return true;
  }
  return std::any_of(all_.begin(), all_.end(),
                     [](const auto& activity) { return activity->isFinished(); });
}

void Activities::forEach(const std::function<void(Activity&)>& action) const {
  for (std::size_t i = 0; i < all_.size(); ++i) action(*all_[i]);
}

pulse::Nanoseconds Activities::due() const {
  pulse::Nanoseconds due = schedule_.due();
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
