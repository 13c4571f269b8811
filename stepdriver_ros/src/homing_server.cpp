#include "homing_server.h"

#include <ros/console.h>

#include <exception>
#include <string>

#include "answer.h"

namespace stepdriver::ros_node {
namespace {

constexpr std::chrono::milliseconds kFeedbackPeriod{100};

}  // namespace

// A homing takes a thread of the axis's queue while its call waits, as a move does. What begins and
// cancels the action answers at once.
HomingServer::HomingServer(const ros::NodeHandle& node, std::size_t index, axis::Axis& axis,
                           CallQueues& queues)
    : axis_(axis),
      node_(onQueue(queues.ofAxis(index), ros::NodeHandle(node, axis.config().name))),
      service_(node_.advertiseService("home", &HomingServer::home, this)),
      action_(
          onQueue(queues.control(), node_), "homing",
          [this](const HomeGoalConstPtr& goal) { execute(goal); }, false) {
  action_.start();
}

bool HomingServer::home(Home::Request& request, Home::Response& response) {
  answer(response, [&] {
    if (request.wait != 0) {
      const axis::HomingResult result = axis_.home();
      response.success = result.end == axis::HomingEnd::kHomed;
      response.message = result.message;
      return;
    }
    background_.start([this] { axis_.checkHoming(); },
                      [this] {
                        try {
                          ROS_INFO_NAMED("homing", "%s", axis_.home().message.c_str());
                        } catch (const std::exception& error) {
                          ROS_ERROR_NAMED("homing", "%s", error.what());
                        }
                      });
    response.message = axis_.config().name + ": is being homed";
  });
  response.position = axis_.state().position;
  return true;
}

void HomingServer::execute(const HomeGoalConstPtr& /*goal*/) {
  HomeResult answer;
  axis::HomingEnd end = axis::HomingEnd::kFailed;
  try {
    told_ = axis::HomingPhase::kNone;
    const axis::HomingResult result = axis_.home([this] {
      tell();
      return action_.isPreemptRequested();
    });
    end = result.end;
    answer.message = result.message;
  } catch (const std::exception& error) {
    answer.message = error.what();
  }
  answer.position = axis_.state().position;
  if (end == axis::HomingEnd::kHomed) {
    action_.setSucceeded(answer, answer.message);
  } else if (end == axis::HomingEnd::kCancelled) {
    action_.setPreempted(answer, answer.message);
  } else {
    action_.setAborted(answer, answer.message);
  }
}

void HomingServer::tell() {
  const axis::AxisState state = axis_.state();
  const Clock::time_point now = Clock::now();
  if (state.homing == told_ && now < told_at_ + kFeedbackPeriod) return;
  told_ = state.homing;
  told_at_ = now;
  HomeFeedback feedback;
  feedback.phase = axis::nameOf(state.homing);
  feedback.position = state.position;
  action_.publishFeedback(feedback);
}

}  // namespace stepdriver::ros_node
