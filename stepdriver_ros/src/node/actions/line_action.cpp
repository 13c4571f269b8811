#include "line_action.h"

#include <algorithm>

#include "move_end.h"
#include "node/line_request.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

// Like the calls of the service, goals wait for their axes in a queue that has a thread for each.
LineAction::LineAction(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues,
                       ActionStatuses& statuses)
    : MotionAction(onQueue(queues.lines(), node), "move_line", statuses, [this] { poll_.begin(); }),
      machine_(machine),
      poll_(onQueue(queues.control(), node), kPollPeriod, [this] { return poll(); }) {
  start();
}

FollowingLine LineAction::begin(const GoalHandle& handle) {
  FollowingLine following;
  following.handle = handle;
  following.move = machine_.moveLine(lineRequest(*handle.getGoal()));
  for (const auto& member : following.move.members) {
    following.began_at.push_back(machine_.axis(member.axis).state().position);
  }
  return following;
}

void LineAction::reject(GoalHandle& handle, const Error& error) {
  MoveLineResult result;
  result.end = MoveLineResult::REFUSED;
  result.message = error.what();
  handle.setRejected(result, result.message);
}

void LineAction::stop(const FollowingLine& following) { machine_.stop(following.move); }

// A line whose axes are stopped before it begins is refused.
void LineAction::cancelBeginning(const GoalHandle& handle) {
  const auto& names = handle.getGoal()->name;
  for (const auto& axis : machine_.axes()) {
    if (std::find(names.begin(), names.end(), axis->config().name) != names.end()) axis->stop();
  }
}

bool LineAction::conclude(FollowingLine& following) {
  const auto ended = machine_.result(following.move);
  if (!ended) return false;
  MoveLineResult result;
  result.end = endOf(ended->end);
  result.message = ended->message;
  result.position = ended->positions;
  result.duration = ended->duration;
  reportEnd(following.handle, result, following.preempted_by);
  return true;
}

void LineAction::watch(FollowingLine& following, bool tell) {
  if (!tell) return;
  MoveLineFeedback feedback;
  feedback.progress = 1.0;
  for (std::size_t i = 0; i < following.began_at.size(); ++i) {
    const auto& member = following.move.members[i];
    const axis::AxisState state = machine_.axis(member.axis).state();
    feedback.position.push_back(state.position);
    feedback.velocity.push_back(state.velocity);
    feedback.progress = std::min(
        feedback.progress, progressOf(following.began_at[i], state.position, member.move.target));
    feedback.time_left = std::max(feedback.time_left, state.time_left);
  }
  following.handle.publishFeedback(feedback);
}

}  // namespace stepdriver::ros_node
