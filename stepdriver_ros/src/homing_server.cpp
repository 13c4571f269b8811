#include "homing_server.h"

#include <ros/console.h>

#include <exception>
#include <string>

#include "answer.h"

namespace stepdriver::ros_node {

// A homing takes a thread of the axis's queue while its call waits, as a move does. What begins and
// cancels the action answers at once.
HomingServer::HomingServer(const ros::NodeHandle& node, std::size_t index, axis::Axis& axis,
                           CallQueues& queues, ActionStatuses& statuses)
    : axis_(axis),
      node_(onQueue(queues.ofAxis(index), ros::NodeHandle(node, axis.config().name))),
      service_(node_.advertiseService("home", &HomingServer::home, this)),
      action_(onQueue(queues.control(), node_), axis, statuses) {}

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

}  // namespace stepdriver::ros_node
