#include "machine_services.h"

#include <fmt/format.h>
#include <ros/console.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AppendPath.h>
#include <stepdriver/FollowPath.h>
#include <stepdriver/MoveLine.h>
#include <stepdriver/PlanPath.h>
#include <stepdriver/Probe.h>
#include <stepdriver/RigReport.h>
#include <stepdriver/SetOutput.h>
#include <stepdriver/SetOutputValue.h>
#include <stepdriver/SetPositionCompare.h>
#include <stepdriver/SpeedOverride.h>

#include <chrono>
#include <exception>
#include <functional>
#include <utility>

#include "common/log_throttle.h"
#include "common/text.h"
#include "node/calls/bounded.h"
#include "node/line_request.h"
#include "node/path_request.h"
#include "node/position_compare_request.h"
#include "node/probe_request.h"
#include "node/topics/output_subscriber.h"
#include "respond.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::ros_node {
namespace {

/// @param what "a line"
/// @tparam Response of MoveLine or FollowPath
template <typename Response>
void answer(machine::Machine& machine, const machine::CoordinatedMove& move, bool wait,
            const char* what, Response& response) {
  for (const auto& [name, own] : move.members) response.target.push_back(own.target);
  if (wait) {
    machine::CoordinatedResult result = machine.wait(move);
    response.success = result.end == axis::MoveEnd::kReached;
    response.message = std::move(result.message);
    response.position = std::move(result.positions);
    response.duration = result.duration;
    return;
  }
  for (const auto& [name, own] : move.members) {
    const config::AxisConfig& axis = machine.axis(name).config();
    response.message += fmt::format("{}{} to {}", response.message.empty() ? "" : ", ", name,
                                    config::placeText(own.target, axis.kind, axis.steps_per_unit));
    response.position.push_back(own.rest);
  }
  response.message =
      fmt::format("{}: {} in {} s", what, response.message, durationText(move.duration));
  response.duration = move.duration;
}

/// "2 short step high, 1 step while asleep"; of steps beyond the limits also the first one.
std::string kindsText(const sim::RigAxisReport& report) {
  std::string text;
  for (const auto& [violation, count] : report.violations) {
    if (!text.empty()) text += ", ";
    text += fmt::format("{} {}", count, sim::nameOf(violation));
  }
  if (!report.beyond_limits.empty()) text += "; first " + report.beyond_limits;
  return text.empty() ? "none" : text;
}

RigReport::Response reportOf(setup::Simulation& simulation) {
  RigReport::Response response;
  // Divided, so that it is the nearest number, which is shown without dust.
  response.time = static_cast<double>(simulation.clock().now()) / 1e9;
  try {
    simulation.rig().flushTrace();
  } catch (const Error& error) {
    static LogThrottle warnings(std::chrono::minutes(1));
    if (warnings.isDue()) ROS_WARN_NAMED("rig", "%s", error.what());
    response.trace_error = error.what();
  }
  for (const config::AxisConfig& axis : simulation.axes()) {
    const double first = simulation.rig().report(axis.traceName(0)).carriage;
    for (std::size_t i = 0; i < axis.motors(); ++i) {
      const std::string name = axis.traceName(i);
      const sim::RigAxisReport report = simulation.rig().report(name);
      response.name.push_back(name);
      response.pulses_forward.push_back(report.pulses_forward);
      response.pulses_backward.push_back(report.pulses_backward);
      response.carriage.push_back(report.carriage / config::configUnitsPerUnit(axis.kind));
      response.skew.push_back((report.carriage - first) / config::configUnitsPerUnit(axis.kind));
      response.fell.push_back(report.fell / config::configUnitsPerUnit(axis.kind));
      response.ringing.push_back(report.ringing / config::configUnitsPerUnit(axis.kind));
      response.largest_lag.push_back(report.largest_lag);
      response.lost_steps.push_back(report.lost_steps);
      response.microsteps.push_back(report.microsteps);
      response.violations.push_back(report.totalViolations());
      response.violation_kinds.push_back(kindsText(report));
    }
  }
  return response;
}

using Trigger = std_srvs::Trigger;
using TriggerFunction = boost::function<bool(Trigger::Request&, Trigger::Response&)>;

/// @param done the message of a successful answer.
TriggerFunction triggerHandler(const std::string& done, const std::function<void()>& action) {
  return [done, action](Trigger::Request& /*request*/, Trigger::Response& response) {
    return respond(response, [&] {
      action();
      response.message = done;
    });
  };
}

}  // namespace

MachineServices::MachineServices(const ros::NodeHandle& node, machine::Machine& machine,
                                 CallQueues& queues)
    : node_(node), queues_(queues) {
  TriggerServer& stops = queues.stops();
  stops.advertise(node_.resolveName("stop"),
                  triggerHandler("all axes stop", [&machine] { machine.stop(); }));
  stops.advertise(
      node_.resolveName("hold"),
      triggerHandler("all axes are on hold until resume or stop; those that move come to rest and "
                     "keep their goals",
                     [&machine] { machine.hold(); }));
  queues.emergency().advertise(node_.resolveName("emergency_stop"),
                               triggerHandler("all axes are stopped; recover ends that",
                                              [&machine] { machine.emergencyStop(); }));
  node_.setCallbackQueue(&queues.control());
  servers_.push_back(node_.advertiseService(
      "recover", triggerHandler("all faults cleared", [&machine] { machine.recover(); })));
  const boost::function<bool(std_srvs::SetBool::Request&, std_srvs::SetBool::Response&)> enable =
      [&machine](std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
        return respond(response, [&] {
          machine.enable(request.data != 0);
          response.message = request.data != 0 ? "all axes are enabled" : "all axes are disabled";
        });
      };
  servers_.push_back(onQueue(queues.powerOfAll(), node_).advertiseService("enable", enable));
  servers_.push_back(node_.advertiseService(
      "resume",
      triggerHandler("the hold is over: held motions continue", [&machine] { machine.resume(); })));
  advertiseSpeedOverride(machine);
  advertiseSetOutput(machine);
  advertiseSetPositionCompare(machine);
  advertiseCoordinatedMoves(machine);
}

void MachineServices::advertiseCoordinatedMoves(machine::Machine& machine) {
  const boost::function<bool(MoveLine::Request&, MoveLine::Response&)> line =
      [&machine](MoveLine::Request& request, MoveLine::Response& response) {
        return respond(response, [&] {
          answer(machine, machine.moveLine(lineRequest(request)), request.wait != 0, "a line",
                 response);
        });
      };
  const boost::function<bool(FollowPath::Request&, FollowPath::Response&)> path =
      [&machine](FollowPath::Request& request, FollowPath::Response& response) {
        return respond(response, [&] {
          if (request.wait != 0 && request.more_follows != 0) {
            throw Refused(
                "wait must be false if more_follows: the answer has the number for append_path");
          }
          const machine::CoordinatedMove move = machine.followPath(pathRequest(request));
          response.path = move.id();
          answer(machine, move, request.wait != 0, "a path", response);
        });
      };
  const boost::function<bool(PlanPath::Request&, PlanPath::Response&)> plan =
      [&machine](PlanPath::Request& request, PlanPath::Response& response) {
        return respond(response, [&] {
          response.duration = machine.pathDuration(wholePath(request), request.begin);
          response.message =
              fmt::format("the path would take {} s", durationText(response.duration));
        });
      };
  const boost::function<bool(AppendPath::Request&, AppendPath::Response&)> append =
      [&machine](AppendPath::Request& request, AppendPath::Response& response) {
        return respond(response, [&] {
          const motion::PathAhead ahead = machine.appendPath(
              {request.path, pathSegments(request.segments), request.more_follows != 0});
          response.target = ahead.targets;
          response.segments_ahead = static_cast<std::uint32_t>(ahead.segments);
          response.room = static_cast<std::uint32_t>(ahead.room);
          response.time_ahead = ahead.time;
          response.message =
              fmt::format("{} segments ({} s) ahead{}", ahead.segments, durationText(ahead.time),
                          ahead.more_follows ? "" : " to the end of the path");
        });
      };
  const boost::function<bool(Probe::Request&, Probe::Response&)> probe =
      [&machine](Probe::Request& request, Probe::Response& response) {
        return respond(response, [&] {
          machine::ProbeResult result = machine.probe(probeRequest(request));
          response.success = result.succeeded;
          response.message = std::move(result.message);
          response.contact = !result.contact.empty();
          response.contact_position = std::move(result.contact);
          response.contact_was_read = result.was_read;
          response.position = std::move(result.positions);
        });
      };
  node_.setCallbackQueue(&queues_.lines());
  servers_.push_back(advertiseBounded(node_, "probe", probe));
  servers_.push_back(advertiseBounded(node_, "move_line", line));
  servers_.push_back(advertiseBounded(node_, "follow_path", path));
  servers_.push_back(advertiseBounded(node_, "plan_path", plan));
  servers_.push_back(advertiseBounded(node_, "append_path", append));
}

void MachineServices::advertiseSpeedOverride(machine::Machine& machine) {
  const boost::function<bool(SpeedOverride::Request&, SpeedOverride::Response&)> handler =
      [&machine](SpeedOverride::Request& request, SpeedOverride::Response& response) {
        return respond(response, [&] {
          machine.setSpeedOverride(request.factor);
          response.message = fmt::format(
              "all axes move at {} times the velocity that is commanded, within their maximum",
              roundedText(request.factor));
        });
      };
  node_.setCallbackQueue(&queues_.control());
  servers_.push_back(node_.advertiseService("speed_override", handler));
}

// A call may wait for the least time of its output, and delays no other.
void MachineServices::advertiseSetOutput(machine::Machine& machine) {
  const boost::function<bool(SetOutput::Request&, SetOutput::Response&)> handler =
      [&machine](SetOutput::Request& request, SetOutput::Response& response) {
        return respond(response, [&] {
          machine.setOutput(request.name, request.on != 0);
          response.message = fmt::format("{} is {}", request.name, request.on != 0 ? "on" : "off");
        });
      };
  node_.setCallbackQueue(&queues_.outputs());
  servers_.push_back(node_.advertiseService("set_output", handler));
  const boost::function<bool(SetOutputValue::Request&, SetOutputValue::Response&)> value_handler =
      [&machine](SetOutputValue::Request& request, SetOutputValue::Response& response) {
        return respond(response, [&] {
          switchTo(machine, request.name, request.value);
          response.message = fmt::format("{} is at {}", request.name, roundedText(request.value));
        });
      };
  servers_.push_back(node_.advertiseService("set_output_value", value_handler));
}

void MachineServices::advertiseSetPositionCompare(machine::Machine& machine) {
  using Request = SetPositionCompare::Request;
  const boost::function<bool(Request&, SetPositionCompare::Response&)> handler =
      [&machine](Request& request, SetPositionCompare::Response& response) {
        return respond(response, [&] {
          if (request.axis.empty()) {
            machine.clearPositionCompare(request.output);
            response.message = fmt::format("no position switches {}", request.output);
            return;
          }
          machine.setPositionCompare(request.output, positionCompare(request));
          response.message =
              fmt::format("the position of {} switches {}", request.axis, request.output);
        });
      };
  node_.setCallbackQueue(&queues_.outputs());
  servers_.push_back(advertiseBounded(node_, "set_position_compare", handler));
}

void MachineServices::advertiseRig(setup::Simulation& simulation) {
  const boost::function<bool(RigReport::Request&, RigReport::Response&)> handler =
      [&simulation](RigReport::Request& /*request*/, RigReport::Response& response) {
        try {
          response = reportOf(simulation);
        } catch (const std::exception& error) {
          ROS_ERROR_NAMED("rig", "%s", error.what());
          return false;
        }
        return true;
      };
  node_.setCallbackQueue(&queues_.control());
  servers_.push_back(node_.advertiseService("rig/report", handler));

  using Press = std_srvs::SetBool;
  const boost::function<bool(Press::Request&, Press::Response&)> press =
      [&simulation](Press::Request& request, Press::Response& response) {
        return respond(response, [&] {
          simulation.pressEmergencyStop(request.data != 0);
          response.message = request.data != 0 ? "the button is pressed" : "the button is released";
        });
      };
  servers_.push_back(node_.advertiseService("rig/emergency_stop", press));
  for (const config::InputConfig& input : simulation.inputs()) {
    advertiseInput(simulation, input.name);
  }
  for (const config::AxisConfig& axis : simulation.axes()) {
    if (axis.hasEndstop(false))
      advertiseEndstop(simulation, axis.name, setup::Simulation::End::kMin);
    if (axis.hasEndstop(true))
      advertiseEndstop(simulation, axis.name, setup::Simulation::End::kMax);
  }
}

void MachineServices::advertiseInput(setup::Simulation& simulation, const std::string& name) {
  using Press = std_srvs::SetBool;
  const boost::function<bool(Press::Request&, Press::Response&)> press =
      [&simulation, name](Press::Request& request, Press::Response& response) {
        return respond(response, [&] {
          simulation.pressInput(name, request.data != 0);
          response.message =
              fmt::format("the input {} is {}", name, request.data != 0 ? "pressed" : "released");
        });
      };
  servers_.push_back(node_.advertiseService("rig/inputs/" + name, press));
}

void MachineServices::advertiseEndstop(setup::Simulation& simulation, const std::string& axis,
                                       setup::Simulation::End end) {
  using Press = std_srvs::SetBool;
  const std::string name = end == setup::Simulation::End::kMin ? "min" : "max";
  const boost::function<bool(Press::Request&, Press::Response&)> press =
      [&simulation, axis, end, name](Press::Request& request, Press::Response& response) {
        return respond(response, [&] {
          simulation.pressEndstop(axis, end, request.data != 0);
          response.message = fmt::format("{}: the switch at the {} end is {}", axis, name,
                                         request.data != 0 ? "pressed" : "released");
        });
      };
  servers_.push_back(node_.advertiseService(fmt::format("rig/{}/press_{}", axis, name), press));
}

}  // namespace stepdriver::ros_node
