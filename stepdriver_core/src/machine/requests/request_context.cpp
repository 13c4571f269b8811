#include "request_context.h"

#include <fmt/format.h>

#include <memory>

#include "activity/driver_activities.h"
#include "gpio/chip_table.h"
#include "message_text.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {

using activity::Activity;

std::string AxisWords::names(const std::vector<AxisId>& axes) const {
  return joinedText(axes, [this](AxisId axis) { return name(axis); });
}

std::string AxisWords::velocity(AxisId axis, double value) const {
  if (value == 0.0) return "";
  return fmt::format(", velocity {} {}/s", numberText(value), unit(axis));
}

std::vector<axis::AxisModel*> RequestContext::withSharers(AxisId id) const {
  std::vector<axis::AxisModel*> axes{&axis(id)};
  axes.insert(axes.end(), axis(id).sharers().begin(), axis(id).sharers().end());
  return axes;
}

const activity::Goal* RequestContext::goalOf(const axis::AxisModel& axis) const {
  const Activity* owner = activities.owner(axis);
  const activity::MotionExecution* motion = owner != nullptr ? owner->motion() : nullptr;
  return motion != nullptr ? motion->goalOf(axis) : nullptr;
}

activity::Goal RequestContext::withOutcome(activity::Goal goal) const {
  goal.move = context.newMove();
  goal.outcome = std::make_shared<axis::Outcome<axis::MoveResult>>();
  return goal;
}

void RequestContext::disable(axis::AxisModel& axis, const activity::EarlyEnd& why,
                             const SharedCall& call) const {
  ++axis.stops;
  for (Activity* at : {activities.owner(axis), activities.heir(axis)}) {
    if (at != nullptr && at->joinDisable(call)) return;
  }
  activities.begin(std::make_unique<activity::Disable>(context, axis, call), why);
}

void RequestContext::refuseUnlessSharersAreFree(const axis::AxisModel& axis,
                                                const std::string& what) const {
  for (const axis::AxisModel* sharer : axis.sharers()) {
    const Activity* const owner = activities.owner(*sharer);
    const bool busy = sharer->moving() || (owner != nullptr && !owner->isInBackground()) ||
                      activities.heir(*sharer) != nullptr;
    if (busy) {
      axis.refuse("busy: " + sharer->name() + ", which shares its motors, is at work; " + what +
                  " when both are at rest");
    }
  }
}

void RequestContext::refuseUnlessFree(const axis::AxisModel& axis, const std::string& what) const {
  axis.refuseUnlessOpen();
  refuseUnlessSharersAreFree(axis, what);
  const Activity* owner = activities.owner(axis);
  if (owner != nullptr && owner->homingPhase() != axis::HomingPhase::kNone) {
    axis.refuse("busy: it is being homed; " + what + " at rest");
  }
  if (axis.moving()) axis.refuse("busy: it moves; " + what + " at rest");
  for (const Activity* busy : {owner, static_cast<const Activity*>(activities.heir(axis))}) {
    if (busy == nullptr || busy->isInBackground()) continue;
    const bool pins =
        busy->work() == Activity::Work::kWritesPins || busy->work() == Activity::Work::kDisables;
    if (!pins) axis.refuseWhileHeld();  // held motions must continue from here
    axis.refuse(pins ? "busy: its driver's pins are being written; " + what + " when that is done"
                     : "busy: it is about to move; " + what + " at rest");
  }
}

void RequestContext::refuseUnlessReadyToMove(const axis::AxisModel& axis) const {
  axis.refuseUnlessReady();
  for (const Activity* busy : {activities.owner(axis), activities.heir(axis)}) {
    if (busy == nullptr || busy->isInBackground() || busy->canHandOver()) continue;
    if (busy->work() == Activity::Work::kDisables) axis.refuse("disabled; enable it first");
    if (busy->work() != Activity::Work::kMoves) {
      axis.refuse("busy: its driver's pins are being written");
    }
  }
  activities.refuseWhileSharersAreBusy(axis);
  axis.refuseWhileHeld();
}

std::string whyNoPin(const config::AxisConfig& axis,
                     std::optional<bool> driver::DriverChip::*active_level, const char* pin,
                     const char* name) {
  for (std::size_t i = 0; i < axis.motors(); ++i) {
    const driver::DriverChip& chip = axis.motorAt(i).driver;
    if (!(chip.*active_level)) return fmt::format("the {} has no {} pin", chip.title, name);
  }
  return fmt::format("pins/{} isn't configured", pin);
}

bool RequestContext::isEmergencyStopInputActive() const {
  if (!emergency_stop) return false;
  const int level = context.levels.level(emergency_stop->line);
  return level < 0 || (level != 0) == emergency_stop->active;
}

void RequestContext::refuseWhileEmergencyStopInput() const {
  if (!isEmergencyStopInputActive()) return;
  const int level = context.levels.level(emergency_stop->line);
  const std::string input = "the emergency stop input " + context.lines.input(emergency_stop->line);
  if (level < 0) throw Refused(input + " can't be read: " + gpio::errorText(-level));
  throw Refused(input + " is active; release it");
}

std::string RequestContext::whySafe() const {
  if (!context.mode.closed.empty()) return context.mode.closed;
  for (const auto& axis : context.axes) {
    if (!axis->fault) continue;
    return fmt::format("{} is at fault: {}", axis->name(), axis->fault.what());
  }
  return context.hasUnknownStop() ? "an emergency stop has come" : "";
}

}  // namespace stepdriver::machine
