#include "axis_home_service.h"

#include <ros/console.h>

#include <exception>
#include <string>

#include "node/homing_results.h"
#include "respond.h"

namespace stepdriver::ros_node {

// Like a move, a homing occupies a thread of the axis's queue while its call waits.
AxisHomeService::AxisHomeService(const ros::NodeHandle& node, std::size_t index, axis::Axis& axis,
                                 CallQueues& queues)
    : axis_(axis),
      service_(onQueue(queues.ofAxis(index), ros::NodeHandle(node, axis.config().name))
                   .advertiseService("home", &AxisHomeService::home, this)) {}

bool AxisHomeService::home(Home::Request& request, Home::Response& response) {
  respond(response, [&] {
    if (request.wait != 0) {
      const axis::HomingResult result = axis_.home();
      response.success = result.end == axis::HomingEnd::kHomed;
      response.message = result.message;
      return;
    }
    task_.start([this] { axis_.checkHoming(); },
                [this] {
                  try {
                    logHoming({axis_.home()});
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
