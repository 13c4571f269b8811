#include "machine_services.h"

#include <ros/console.h>
#include <stepdriver/HomeAxes.h>
#include <stepdriver/SpeedOverride.h>

#include <algorithm>
#include <exception>

#include "answer.h"
#include "text.h"

namespace stepdriver::ros_node {
namespace {

bool areAllHomed(const std::vector<axis::HomingResult>& results) {
  return std::all_of(results.begin(), results.end(), [](const axis::HomingResult& result) {
    return result.end == axis::HomingEnd::kHomed;
  });
}

std::string messageOf(const std::vector<axis::HomingResult>& results) {
  std::string text;
  for (const axis::HomingResult& result : results) {
    text += (text.empty() ? "" : "; ") + result.message;
  }
  return text;
}

void homeAndLog(machine::Machine& machine, const std::vector<std::string>& names) {
  try {
    ROS_INFO("%s", messageOf(machine.home(names)).c_str());
  } catch (const std::exception& error) {
    ROS_ERROR("%s", error.what());
  }
}

}  // namespace

MachineServices::MachineServices(const ros::NodeHandle& node, machine::Machine& machine,
                                 CallQueues& queues)
    : node_(node), queues_(queues) {
  advertise("stop", queues.control(), "all axes stop", [&machine] { machine.stop(); });
  advertise("emergency_stop", queues.emergency(), "all axes are stopped; recover ends that",
            [&machine] { machine.emergencyStop(); });
  advertise("recover", queues.control(), "all faults are ended", [&machine] { machine.recover(); });
  advertiseSpeedOverride(machine);
  advertiseHome(machine);
}

void MachineServices::advertiseSpeedOverride(machine::Machine& machine) {
  const boost::function<bool(SpeedOverride::Request&, SpeedOverride::Response&)> handler =
      [&machine](SpeedOverride::Request& request, SpeedOverride::Response& response) {
        return answer(response, [&] {
          machine.setSpeedOverride(request.factor);
          response.message = "all axes move at " + numberText(request.factor) +
                             " times the velocity that is commanded, within their maximum";
        });
      };
  node_.setCallbackQueue(&queues_.control());
  servers_.push_back(node_.advertiseService("speed_override", handler));
}

void MachineServices::advertiseHome(machine::Machine& machine) {
  const boost::function<bool(HomeAxes::Request&, HomeAxes::Response&)> handler =
      [this, &machine](HomeAxes::Request& request, HomeAxes::Response& response) {
        return answer(response, [&] {
          if (request.wait != 0) {
            const auto results = machine.home(request.name);
            response.success = areAllHomed(results);
            response.message = messageOf(results);
            return;
          }
          background_.start([&] { machine.checkHoming(request.name); },
                            [&machine, names = request.name] { homeAndLog(machine, names); });
          response.message = "the axes are being homed";
        });
      };
  node_.setCallbackQueue(&queues_.together());
  servers_.push_back(node_.advertiseService("home", handler));
}

void MachineServices::advertise(const std::string& name, ros::CallbackQueue& queue,
                                const std::string& done, const std::function<void()>& action) {
  using Service = std_srvs::Trigger;
  const boost::function<bool(Service::Request&, Service::Response&)> handler =
      [done, action](Service::Request& /*request*/, Service::Response& response) {
        return answer(response, [&] {
          action();
          response.message = done;
        });
      };
  node_.setCallbackQueue(&queue);
  servers_.push_back(node_.advertiseService(name, handler));
}

void MachineServices::advertiseRig(Simulation& simulation) {
  const boost::function<bool(RigReport::Request&, RigReport::Response&)> handler =
      [&simulation](RigReport::Request& /*request*/, RigReport::Response& response) {
        try {
          response = simulation.report();
        } catch (const std::exception& error) {
          ROS_ERROR("%s", error.what());
          return false;
        }
        return true;
      };
  node_.setCallbackQueue(&queues_.control());
  servers_.push_back(node_.advertiseService("rig/report", handler));
}

}  // namespace stepdriver::ros_node
