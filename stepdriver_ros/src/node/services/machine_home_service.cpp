#include "machine_home_service.h"

#include <ros/console.h>

#include <exception>
#include <string>
#include <vector>

#include "node/calls/bounded.h"
#include "node/homing_results.h"
#include "respond.h"

namespace stepdriver::ros_node {
namespace {

void homeAndLog(machine::Machine& machine, const std::vector<std::string>& names) {
  try {
    logHoming(machine.home(names));
  } catch (const std::exception& error) {
    ROS_ERROR_NAMED("homing", "%s", error.what());
  }
}

}  // namespace

// Like lines, homings wait in a queue that has a thread for each axis.
MachineHomeService::MachineHomeService(ros::NodeHandle node, machine::Machine& machine,
                                       CallQueues& queues)
    : machine_(machine) {
  node.setCallbackQueue(&queues.lines());
  const boost::function<bool(HomeAxes::Request&, HomeAxes::Response&)> handler =
      [this](HomeAxes::Request& request, HomeAxes::Response& response) {
        return home(request, response);
      };
  service_ = advertiseBounded(node, "home", handler);
}

bool MachineHomeService::home(HomeAxes::Request& request, HomeAxes::Response& response) {
  return respond(response, [&] {
    if (request.wait != 0) {
      const auto results = machine_.home(request.name);
      response.success = areAllHomed(results);
      response.message = messageOf(results);
      return;
    }
    task_.start([&] { machine_.checkHoming(request.name); },
                [this, names = request.name] { homeAndLog(machine_, names); });
    response.message = "the axes are being homed";
  });
}

}  // namespace stepdriver::ros_node
