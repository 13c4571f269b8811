#pragma once

#include <ros/node_handle.h>
#include <stepdriver/FollowPathAction.h>

#include <algorithm>
#include <cstdint>

#include "coordinated_action.h"
#include "node/path_request.h"

namespace stepdriver::ros_node {

/// The action ~follow_path: the service as an action.
class PathAction : public CoordinatedAction<FollowPathAction> {
 public:
  /// @param node the node's private handle.
  /// @param machine, queues, statuses outlive the action.
  PathAction(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues,
             ActionStatuses& statuses)
      : CoordinatedAction(node, "follow_path", machine, queues, statuses) {
    start();
  }

 private:
  machine::CoordinatedMove move(const FollowPathGoal& goal) override {
    return machine().followPath(pathRequest(goal));
  }

  // By the planned time: a path may pass the same place several times. While it is held, the time
  // left is that until it is at rest.
  double progressOfGoal(const Following& following, const States& states) const override {
    double time_left = 0.0;
    for (const axis::AxisState& state : states) {
      if (state.held) return following.progress;
      time_left = std::max(time_left, state.time_left);
    }
    if (const auto ahead = machine().pathAhead(following.move.id())) {
      const double all = ahead->passed + ahead->time;
      return std::clamp(all > 0.0 ? ahead->passed / all : 0.0, following.progress, 1.0);
    }
    const double duration = following.move.duration;
    const double covered = duration > 0.0 ? 1.0 - time_left / duration : 1.0;
    return std::clamp(covered, following.progress, 1.0);
  }

  void complete(const Following& following, FollowPathFeedback& feedback) const override {
    feedback.path = following.move.id();
    if (const auto ahead = machine().pathAhead(feedback.path)) {
      feedback.segments_ahead = static_cast<std::uint32_t>(ahead->segments);
    }
  }
};

}  // namespace stepdriver::ros_node
