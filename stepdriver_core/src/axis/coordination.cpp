#include "stepdriver_core/axis/coordination.h"

#include <cmath>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>

#include "axis_impl.h"
#include "line_course.h"
#include "message_text.h"
#include "trajectory_course.h"

namespace stepdriver::axis {
namespace {

void refuseBadNumber(const Axis::Impl& axis, const std::string& what, double value) {
  if (std::isfinite(value) && value >= 0.0) return;
  axis.refuse("the " + what + " is " + numberText(value) + ", but must be 0 or above, and finite");
}

Orders ordersFor(const std::shared_ptr<Course>& course, const std::vector<std::int64_t>& targets) {
  Orders orders;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    Goal goal;
    goal.kind = Goal::Kind::kTogether;
    goal.target = targets[i];
    goal.course = course;
    goal.member = i;
    orders.push_back({course->axes()[i], std::move(goal)});
  }
  return orders;
}

}  // namespace

std::vector<Axis::Impl*> Coordination::implsOf(const std::vector<Axis*>& axes) {
  std::vector<Axis::Impl*> impls;
  impls.reserve(axes.size());
  for (Axis* axis : axes) impls.push_back(axis->impl_.get());
  return impls;
}

std::vector<Move> Coordination::moveLine(const std::vector<Axis*>& axes,
                                         const std::vector<double>& positions, bool relative,
                                         double velocity, double duration) {
  const std::vector<Axis::Impl*> impls = implsOf(axes);
  std::unique_lock<std::mutex> lock(impls.front()->mutex);
  refuseBadNumber(*impls.front(), "velocity of the line", velocity);
  refuseBadNumber(*impls.front(), "duration of the line", duration);
  if (velocity > 0.0 && duration > 0.0) {
    impls.front()->refuse("the line has a velocity and a duration; give one of them");
  }
  std::vector<std::int64_t> targets;
  for (std::size_t i = 0; i < impls.size(); ++i) {
    targets.push_back(impls[i]->checkedTarget(positions[i], relative));
  }
  for (Axis::Impl* axis : impls) axis->awaitRest(lock, "a line was to begin");
  for (std::size_t i = 0; i < impls.size(); ++i) {
    impls[i]->refuseUnlessReadyToMove();
    impls[i]->refuseIntoEndstop(targets[i] - impls[i]->jointCount());
  }
  for (std::size_t i = 0; i < impls.size(); ++i) {
    impls[i]->takeUpBacklash(lock, targets[i] - impls[i]->jointCount());
  }
  const auto course = std::make_shared<LineCourse>(impls, targets, velocity);
  if (duration > 0.0) course->stretchTo(duration);
  return Axis::Impl::begin(ordersFor(course, targets));
}

std::vector<Move> Coordination::follow(const std::vector<Axis*>& axes,
                                       const std::vector<CoursePoint>& points) {
  const std::vector<Axis::Impl*> impls = implsOf(axes);
  const std::lock_guard<std::mutex> lock(impls.front()->mutex);
  for (Axis::Impl* axis : impls) {
    axis->refuseUnlessReadyToMove();
    axis->refuseUnlessHomed();
  }
  const auto course = std::make_shared<TrajectoryCourse>(impls, points);
  return Axis::Impl::begin(ordersFor(course, course->targets()));
}

bool Coordination::leads(const Axis& axis) {
  const std::lock_guard<std::mutex> lock(axis.impl_->mutex);
  return axis.impl_->leads();
}

}  // namespace stepdriver::axis
