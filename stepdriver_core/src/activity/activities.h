#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "activity.h"
#include "context.h"
#include "schedule.h"

namespace stepdriver::activity {

/// The owner and the heir of each axis. Ownership changes only here.
///
/// An axis has at most one owner and at most one heir: the heir has been accepted, and begins when
/// the owners of all its axes have finished. Until then they only come to rest, or complete their
/// writes of pins. Ending an owner also ends its heir.
class Activities {
 public:
  explicit Activities(Context& context) : context_(context), schedule_(context) {}

  Activity* owner(const axis::AxisModel& axis) const { return find(axis, true); }
  Activity* heir(const axis::AxisModel& axis) const { return find(axis, false); }
  /// It has no owner and no heir.
  bool isFree(const axis::AxisModel& axis) const {
    return owner(axis) == nullptr && heir(axis) == nullptr;
  }

  /// @throw Refused if an axis that shares the motors of this one is homed, or has its driver's
  ///   pins written.
  void refuseWhileSharersAreBusy(const axis::AxisModel& axis) const;

  /// Gives an activity its axes: at once, from motions that it takes over, or as the heir of their
  /// present owners. Replaced activities are told why.
  ///
  /// @param why the reason given to activities that it ends instead of taking over.
  /// @throw Refused if it can't take over; then nothing has changed.
  void begin(std::unique_ptr<Activity> activity, const EarlyEnd& why);

  /// Ends the owner and the heir of an axis.
  void end(const axis::AxisModel& axis, const EarlyEnd& why, const SharedCall& call = {});
  void endAll(const EarlyEnd& why, const SharedCall& call = {});

  /// A motion that begins later. @throw Refused if an axis can't be taken over then; then nothing
  /// has changed.
  /// @return the move of each axis.
  std::vector<axis::Move> beginLater(LaterMotion motion);
  Schedule& schedule() { return schedule_; }
  const Schedule& schedule() const { return schedule_; }

  /// Each owner handles what has happened; finished activities leave their axes, and heirs begin.
  void poll();

  void forEach(const std::function<void(Activity&)>& action) const;
  pulse::Nanoseconds due() const;
  bool watchInputs() const;

 private:
  Activity* find(const axis::AxisModel& axis, bool begun) const;
  void takeOver(std::unique_ptr<Activity> activity);
  void beginParts(Activity& of);
  void lookAtSchedule();
  bool mayBeTakenOver(const axis::AxisModel& axis) const;
  bool sweep();
  bool mayBegin(const Activity& activity) const;

  Context& context_;
  Schedule schedule_;
  std::vector<std::unique_ptr<Activity>> all_;  // in the order in which they were accepted
};

}  // namespace stepdriver::activity
