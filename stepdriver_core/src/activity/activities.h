#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "activity.h"
#include "context.h"

namespace stepdriver::activity {

/// Who owns which axis, and who is to own it next: the one place in which that changes.
///
/// An axis has one owner at most, and one heir at most: the heir has been accepted, and begins when
/// the owners of all its axes have finished. Until then they only come to rest, or complete what
/// they write to their pins. What ends an owner ends its heir too.
class Activities {
 public:
  explicit Activities(Context& context) : context_(context) {}

  Activity* owner(const axis::AxisModel& axis) const { return find(axis, true); }
  Activity* heir(const axis::AxisModel& axis) const { return find(axis, false); }
  /// Nobody owns it, or is to.
  bool isFree(const axis::AxisModel& axis) const {
    return owner(axis) == nullptr && heir(axis) == nullptr;
  }

  /// Gives an activity its axes: at once, from motions that it takes over, or as the heir of those
  /// who own them now. Who is replaced is told why.
  ///
  /// @param why what those hear whom it doesn't take over from.
  /// @throw Refused if it can't take over; then nothing has changed.
  void begin(std::unique_ptr<Activity> activity, const Why& why);

  /// Ends what an axis does, and what it was to do next.
  void end(const axis::AxisModel& axis, const Why& why, const Ack& call = {});
  void endAll(const Why& why, const Ack& call = {});

  /// Each owner looks at what has happened; who has finished leaves its axes, and heirs begin.
  void look();

  void forEach(const std::function<void(Activity&)>& action) const;
  pulse::Nanoseconds due() const;
  bool watchInputs() const;

 private:
  Activity* find(const axis::AxisModel& axis, bool begun) const;
  void takeOver(std::unique_ptr<Activity> activity);
  bool sweep();
  bool mayBegin(const Activity& activity) const;

  Context& context_;
  std::vector<std::unique_ptr<Activity>> all_;  // in the order in which they were accepted
};

}  // namespace stepdriver::activity
