#include "storm/driver_calls.h"

#include <actionlib_msgs/GoalID.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AppendPath.h>
#include <stepdriver/FollowPath.h>
#include <stepdriver/Home.h>
#include <stepdriver/HomeAxes.h>
#include <stepdriver/Jog.h>
#include <stepdriver/LatchActionGoal.h>
#include <stepdriver/Microstep.h>
#include <stepdriver/MoveActionGoal.h>
#include <stepdriver/MoveLine.h>
#include <stepdriver/MoveRounds.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/PathSegment.h>
#include <stepdriver/Probe.h>
#include <stepdriver/SetCurrent.h>
#include <stepdriver/SetLimits.h>
#include <stepdriver/SetOutput.h>
#include <stepdriver/SetOutputValue.h>
#include <stepdriver/SetPosition.h>
#include <stepdriver/SetPositionCompare.h>
#include <stepdriver/SpeedOverride.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numeric>
#include <type_traits>
#include <utility>

#include "storm/storm_machine.h"
#include "support/control_msgs_client.h"

namespace stepdriver::storm {
namespace {

using TrajectoryGoal = node_test::action_msgs::FollowJointTrajectoryActionGoal;

std::string shown(double number) {
  char text[32];
  std::snprintf(text, sizeof text, "%.5g", number);
  return text;
}

std::string shown(const std::vector<std::size_t>& axes, const std::vector<double>& positions) {
  std::string text;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    text += " " + kAxisNames.at(axes[i]) + " " + shown(positions[i]);
  }
  return text;
}

AxisSet setOf(const std::vector<std::size_t>& axes) {
  AxisSet set = 0;
  for (const std::size_t axis : axes) set |= 1U << axis;
  return set;
}

trajectory_msgs::JointTrajectory trajectoryOf(const std::vector<std::size_t>& axes,
                                              const std::vector<double>& positions,
                                              double duration) {
  trajectory_msgs::JointTrajectory trajectory;
  for (const std::size_t axis : axes) {
    trajectory.joint_names.push_back(kAxisNames.at(axis) + "_joint");
  }
  trajectory_msgs::JointTrajectoryPoint point;
  point.positions = positions;
  point.velocities.assign(axes.size(), 0.0);
  point.accelerations.assign(axes.size(), 0.0);
  point.time_from_start = ros::Duration(duration);
  trajectory.points.push_back(point);
  return trajectory;
}

Request motionOf(int client, AxisSet axes, const std::string& text) {
  Request request;
  request.client = client;
  request.kind = Kind::kMotion;
  request.axes = axes;
  request.text = text;
  return request;
}

Request messageOf(int client, AxisSet axes, const std::string& text) {
  Request request = motionOf(client, axes, text);
  request.has_answer = false;
  return request;
}

/// A request that leads an axis to a position, or by a way.
Request leadingTo(Request request, std::size_t axis, double place, bool relative) {
  request.reaches.push_back({axis, place, place, relative});
  return request;
}

Request requestOf(Kind kind, AxisSet axes, const std::string& text, bool wait = false) {
  Request request;
  request.kind = kind;
  request.axes = axes;
  request.text = text + (wait ? " and wait" : "");
  request.waits = wait;
  return request;
}

}  // namespace

const std::vector<std::string> kAxisNames{"x", "y", "z"};

DriverTopics::DriverTopics(const std::string& node, RequestLog& log) : log_(log) {
  ros::NodeHandle handle(node);
  jog_ = handle.advertise<Jog>("jog", 100);
  command_ = handle.advertise<trajectory_msgs::JointTrajectory>("command", 100);
  trajectory_goal_ = handle.advertise<TrajectoryGoal>("follow_joint_trajectory/goal", 100);
  trajectory_cancel_ =
      handle.advertise<actionlib_msgs::GoalID>("follow_joint_trajectory/cancel", 100);
  latch_goal_ = handle.advertise<LatchActionGoal>("latch/goal", 100);
  latch_cancel_ = handle.advertise<actionlib_msgs::GoalID>("latch/cancel", 100);
  for (const std::string& output : kOutputs) {
    outputs_.push_back(handle.advertise<std_msgs::Float64>("outputs/" + output, 100));
  }
  setpoints_ = handle.advertise<std_msgs::Float64MultiArray>("setpoint", 100);
  for (const std::string& axis : kAxisNames) {
    setpoint_.push_back(handle.advertise<std_msgs::Float64>(axis + "/setpoint", 100));
    move_goals_.push_back(handle.advertise<MoveActionGoal>(axis + "/move/goal", 100));
    move_cancels_.push_back(handle.advertise<actionlib_msgs::GoalID>(axis + "/move/cancel", 100));
  }
}

bool DriverTopics::connected() const {
  const auto heard = [](const ros::Publisher& topic) { return topic.getNumSubscribers() > 0; };
  return heard(jog_) && heard(setpoints_) && heard(command_) && heard(trajectory_goal_) &&
         heard(trajectory_cancel_) && heard(latch_goal_) && heard(latch_cancel_) &&
         std::all_of(setpoint_.begin(), setpoint_.end(), heard) &&
         std::all_of(outputs_.begin(), outputs_.end(), heard) &&
         std::all_of(move_goals_.begin(), move_goals_.end(), heard) &&
         std::all_of(move_cancels_.begin(), move_cancels_.end(), heard);
}

void DriverTopics::jog(int client, std::size_t axis, double velocity) {
  stepdriver::Jog jog;
  jog.name = {kAxisNames.at(axis)};
  jog.velocity = {velocity};
  JogMessage message;
  // The messages in the log have the same order as on the topic.
  const std::lock_guard<std::mutex> lock(mutex_);
  JogMessage& last = jogs_[axis];
  message.at = steadyNow();
  message.moves = velocity != 0.0;
  const bool begins = !last.moves || message.at - last.at > std::llround(kJogTimeout * 0.4e9);
  if (message.moves && begins) {
    Request request =
        messageOf(client, 1U << axis, kAxisNames.at(axis) + ": jog " + shown(velocity));
    request.kind = Kind::kJog;
    log_.begin(request);
  }
  last = message;
  jog_.publish(jog);
}

void DriverTopics::noteSetpoints(int client, const std::vector<std::size_t>& axes,
                                 const std::vector<double>& positions) {
  const std::int64_t now = steadyNow();
  std::vector<std::size_t> beginning;
  std::vector<double> of_these;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const auto last = setpoints_sent_.find(axes[i]);
    const bool begins =
        last == setpoints_sent_.end() || now - last->second > std::llround(kJogTimeout * 0.4e9);
    setpoints_sent_[axes[i]] = now;
    if (!begins) continue;
    beginning.push_back(axes[i]);
    of_these.push_back(positions[i]);
  }
  if (beginning.empty()) return;
  Request request = messageOf(client, setOf(beginning), "setpoints" + shown(beginning, of_these));
  request.kind = Kind::kJog;
  log_.begin(request);
}

void DriverTopics::setpoint(int client, std::size_t axis, double position) {
  std_msgs::Float64 message;
  message.data = position;
  const std::lock_guard<std::mutex> lock(mutex_);
  noteSetpoints(client, {axis}, {position});
  setpoint_.at(axis).publish(message);
}

void DriverTopics::setpoints(int client, const std::vector<double>& positions) {
  std_msgs::Float64MultiArray message;
  message.data = positions;
  std::vector<std::size_t> axes(positions.size());
  std::iota(axes.begin(), axes.end(), 0);
  const std::lock_guard<std::mutex> lock(mutex_);
  noteSetpoints(client, axes, positions);
  setpoints_.publish(message);
}

void DriverTopics::command(int client, const std::vector<std::size_t>& axes,
                           const std::vector<double>& positions, double duration) {
  Request request = messageOf(client, setOf(axes),
                              "command" + shown(axes, positions) + " in " + shown(duration) + " s");
  request.is_trajectory = true;
  log_.begin(request);
  command_.publish(trajectoryOf(axes, positions, duration));
}

void DriverTopics::followTrajectory(int client, const std::vector<std::size_t>& axes,
                                    const std::vector<double>& positions, double duration,
                                    double ahead) {
  TrajectoryGoal goal;
  goal.goal.trajectory = trajectoryOf(axes, positions, duration);
  std::string text =
      "follow_joint_trajectory" + shown(axes, positions) + " in " + shown(duration) + " s";
  if (ahead > 0.0) {
    goal.goal.trajectory.header.stamp = ros::Time::now() + ros::Duration(ahead);
    text += ", " + shown(ahead) + " s ahead";
  }
  Request request = messageOf(client, setOf(axes), text);
  request.is_trajectory = true;
  goal.goal_id.id = std::to_string(log_.begin(request));
  trajectory_goal_.publish(goal);
}

void DriverTopics::cancelTrajectories() { trajectory_cancel_.publish(actionlib_msgs::GoalID()); }

void DriverTopics::moveByAction(int client, std::size_t axis, double position, bool relative) {
  MoveActionGoal goal;
  goal.goal.position = position;
  goal.goal.relative = relative;
  goal.goal_id.id = std::to_string(log_.begin(
      messageOf(client, 1U << axis,
                kAxisNames.at(axis) + "/move " + (relative ? "by " : "to ") + shown(position))));
  move_goals_.at(axis).publish(goal);
}

void DriverTopics::cancelMove(std::size_t axis) {
  move_cancels_.at(axis).publish(actionlib_msgs::GoalID());
}

void DriverTopics::latch(int client, bool every, const std::optional<WindowOrder>& window) {
  LatchActionGoal goal;
  goal.goal.input = kInput;
  goal.goal.edge = LatchGoal::EITHER;
  goal.goal.every = every;
  Request request = messageOf(client, 0U, every ? "latch of every edge" : "latch");
  request.kind = Kind::kOther;
  if (window) {
    goal.goal.window_axis = kAxisNames.at(window->axis);
    goal.goal.window_from = window->from;
    goal.goal.window_to = window->to;
    request.window = window;
    request.text += " in a window of " + kAxisNames.at(window->axis);
  }
  goal.goal_id.id = std::to_string(log_.begin(request));
  latch_goal_.publish(goal);
}

void DriverTopics::output(int client, std::size_t output, double value) {
  Request request = messageOf(client, 0U, "outputs/" + kOutputs.at(output) + " " + shown(value));
  request.kind = Kind::kOther;
  log_.begin(request);
  std_msgs::Float64 message;
  message.data = value;
  outputs_.at(output).publish(message);
}

void DriverTopics::cancelLatches() { latch_cancel_.publish(actionlib_msgs::GoalID()); }

template <typename Service, typename Reader>
bool DriverCalls::call(Request request, const std::string& service, Service& call,
                       const Reader& answer) {
  request.client = client_;
  const std::size_t index = log_.begin(std::move(request));
  ros::ServiceClient& client = clients_[service];
  if (!client.isValid()) {
    client = ros::NodeHandle(node_).serviceClient<Service>(service, true);
  }
  // A node that has died doesn't answer.
  if (!client.call(call)) return false;
  const bool success = call.response.success != 0;
  log_.end(index, success, call.response.message, success ? answer(call.response) : Answer());
  return success;
}

template <typename Service>
bool DriverCalls::call(Request request, const std::string& service, Service& call) {
  return this->call(std::move(request), service, call,
                    [](const auto& /*response*/) { return Answer(); });
}

bool DriverCalls::moveTo(std::size_t axis, double position, bool relative, bool wait) {
  MoveTo service;
  service.request.position = position;
  service.request.relative = relative;
  service.request.wait = wait;
  const std::string name = kAxisNames.at(axis) + "/move_to";
  return call(leadingTo(requestOf(Kind::kMotion, 1U << axis,
                                  name + (relative ? " by " : " ") + shown(position), wait),
                        axis, position, relative),
              name, service, [&](const MoveTo::Response& response) {
                Answer answer;
                if (!relative && wait) answer.arrivals = {{axis, position, response.position}};
                return answer;
              });
}

bool DriverCalls::moveRounds(std::size_t axis, double rounds, bool wait) {
  MoveRounds service;
  service.request.rounds = rounds;
  service.request.wait = wait;
  const std::string name = kAxisNames.at(axis) + "/move_rounds";
  return call(requestOf(Kind::kMotion, 1U << axis, name + " " + shown(rounds), wait), name,
              service);
}

bool DriverCalls::moveLine(const std::vector<std::size_t>& axes,
                           const std::vector<double>& positions, bool relative, double duration,
                           bool wait) {
  MoveLine service;
  for (const std::size_t axis : axes) service.request.name.push_back(kAxisNames.at(axis));
  service.request.position = positions;
  service.request.relative = relative;
  service.request.duration = duration;
  service.request.wait = wait;
  Request request =
      requestOf(Kind::kMotion, setOf(axes),
                std::string("move_line") + (relative ? " by" : "") + shown(axes, positions) +
                    (duration > 0.0 ? " in " + shown(duration) + " s" : ""),
                wait);
  for (std::size_t i = 0; i < axes.size(); ++i) {
    request = leadingTo(std::move(request), axes[i], positions[i], relative);
  }
  return call(std::move(request), "move_line", service, [&](const MoveLine::Response& response) {
    Answer answer;
    if (relative || !wait) return answer;
    for (std::size_t i = 0; i < axes.size(); ++i) {
      answer.arrivals.push_back({axes[i], positions[i], response.position.at(i)});
    }
    return answer;
  });
}

namespace {

constexpr double kLeadOn = 0.02;   // [s]
constexpr double kLeadOff = 0.01;  // [s]

/// A place on a segment of a path.
struct OnTheWay {
  std::size_t segment;
  double part;  // of its length
  bool on;
};
// Corners are rounded within half of a segment at most.
constexpr std::array<OnTheWay, 4> kOnTheWay{
    {{0, 0.5, true}, {1, 0.5, false}, {2, 0.5, true}, {2, 0.75, false}}};

std::vector<stepdriver::PathSegment> zigzag(std::size_t axes, double size,
                                            DriverCalls::Marks marks) {
  std::vector<stepdriver::PathSegment> segments(3);
  const auto add = [](stepdriver::PathSegment& segment, bool on, double distance) {
    stepdriver::OutputSwitch output;
    output.name = kPathOutput;
    output.on = on ? 1 : 0;
    output.distance = distance;
    segment.outputs.push_back(output);
  };
  std::vector<double> begin(axes, 0.0);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    double length = 0.0;
    for (std::size_t axis = 0; axis < axes; ++axis) {
      segments[i].end.push_back((i + axis) % 2 == 0 ? size : -size / 2.0);
      length = std::hypot(length, segments[i].end.back() - begin[axis]);
    }
    begin = segments[i].end;
    if (marks == DriverCalls::Marks::kAtCorners && i > 0) add(segments[i], i == 1, 0.0);
    if (marks != DriverCalls::Marks::kOnTheWay) continue;
    for (const OnTheWay& place : kOnTheWay) {
      if (place.segment == i) add(segments[i], place.on, place.part * length);
    }
  }
  return segments;
}

/// The places of Marks::kOnTheWay.
std::vector<MarkOrder> marksOf(const std::vector<stepdriver::PathSegment>& segments) {
  std::vector<MarkOrder> marks;
  for (const OnTheWay& place : kOnTheWay) {
    MarkOrder& mark = marks.emplace_back();
    mark.output = kPathOutputIndex;
    mark.on = place.on;
    mark.lead = place.on ? kLeadOn : kLeadOff;
    for (std::size_t axis = 0; axis < segments.front().end.size(); ++axis) {
      const double begin = place.segment == 0 ? 0.0 : segments[place.segment - 1].end[axis];
      mark.position.push_back(begin + place.part * (segments[place.segment].end[axis] - begin));
    }
  }
  return marks;
}

}  // namespace

std::uint64_t DriverCalls::followPath(const std::vector<std::size_t>& axes, double size,
                                      bool more_follows, double velocity, Marks marks) {
  stepdriver::FollowPath service;
  for (const std::size_t axis : axes) service.request.name.push_back(kAxisNames.at(axis));
  service.request.segments = zigzag(axes.size(), size, marks);
  service.request.relative = true;
  service.request.tolerance = 0.0005;
  service.request.velocity = velocity;
  service.request.more_follows = more_follows;
  Request request = requestOf(Kind::kMotion, setOf(axes),
                              "follow_path of " + shown(size) + " at " + shown(velocity), false);
  request.is_path = true;
  if (marks == Marks::kOnTheWay) {
    stepdriver::OutputLead lead;
    lead.name = kPathOutput;
    lead.on = kLeadOn;
    lead.off = kLeadOff;
    service.request.leads.push_back(lead);
    request.path_axes = axes;
    request.marks = marksOf(service.request.segments);
  }
  for (const std::size_t axis : axes) {
    // A corner is rounded on the inside, and the path may deviate by its tolerance.
    request.reaches.push_back({axis, std::min(size, -size / 2.0) - service.request.tolerance,
                               std::max(size, -size / 2.0) + service.request.tolerance, true});
  }
  std::uint64_t path = 0;
  call(request, "follow_path", service, [&path](const stepdriver::FollowPath::Response& response) {
    path = response.path;
    return Answer();
  });
  return path;
}

bool DriverCalls::appendPath(std::uint64_t path, const std::vector<std::size_t>& axes, double size,
                             bool more_follows, Marks marks) {
  stepdriver::AppendPath service;
  service.request.path = path;
  service.request.segments = zigzag(axes.size(), size, marks);
  service.request.more_follows = more_follows;
  return call(requestOf(Kind::kOther, 0U, "append_path of " + shown(size), false), "append_path",
              service);
}

bool DriverCalls::probe(std::size_t axis, double position, bool away, bool twice, bool returns) {
  Probe service;
  service.request.name = {kAxisNames.at(axis)};
  service.request.position = {position};
  service.request.input = kInput;
  service.request.away = away;
  service.request.may_miss = true;
  if (twice) {
    service.request.second_velocity = 0.005;
    service.request.back_off = 0.001;
  }
  service.request.go_back = returns;
  Request request = requestOf(Kind::kMotion, 1U << axis,
                              "probe " + kAxisNames.at(axis) + " " + shown(position), true);
  request.probe = ProbeOrder{axis, !away};
  return call(leadingTo(std::move(request), axis, position, false), "probe", service,
              [](const Probe::Response& response) {
                Answer answer;
                if (response.contact != 0) answer.contact = response.contact_position.front();
                return answer;
              });
}

bool DriverCalls::setOutput(std::size_t output, bool on) {
  SetOutput service;
  service.request.name = kOutputs.at(output);
  service.request.on = on;
  Request request =
      requestOf(Kind::kOther, 0U, "set_output " + kOutputs.at(output) + (on ? " on" : " off"));
  request.output = OutputOrder{output, on};
  return call(std::move(request), "set_output", service);
}

bool DriverCalls::setOutputValue(std::size_t output, double value) {
  SetOutputValue service;
  service.request.name = kOutputs.at(output);
  service.request.value = value;
  Request request =
      requestOf(Kind::kOther, 0U, "set_output_value " + kOutputs.at(output) + " " + shown(value));
  request.output = OutputOrder{output, value > 0.0};
  return call(std::move(request), "set_output_value", service);
}

bool DriverCalls::home(std::size_t axis, bool wait) {
  Home service;
  service.request.wait = wait;
  const std::string name = kAxisNames.at(axis) + "/home";
  return call(requestOf(Kind::kHoming, 1U << axis, name, wait), name, service);
}

bool DriverCalls::homeAll(bool wait) {
  HomeAxes service;
  service.request.wait = wait;
  return call(requestOf(Kind::kHoming, kAllAxes, "home", wait), "home", service);
}

bool DriverCalls::microstep(std::size_t axis, int microsteps) {
  Microstep service;
  service.request.microsteps = microsteps;
  const std::string name = kAxisNames.at(axis) + "/microstep";
  // It may move to a position that both modes have; it answers after that move.
  return call(requestOf(Kind::kMotion, 1U << axis, name + " " + std::to_string(microsteps), true),
              name, service);
}

bool DriverCalls::setLimits(std::size_t axis, double max_speed, double acceleration, double jerk) {
  SetLimits service;
  service.request.max_speed = max_speed;
  service.request.acceleration = acceleration;
  service.request.deceleration = acceleration;
  service.request.jerk = jerk;
  const std::string name = kAxisNames.at(axis) + "/set_limits";
  return call(
      requestOf(Kind::kOther, 1U << axis,
                name + " " + shown(max_speed) + " " + shown(acceleration) + " " + shown(jerk)),
      name, service);
}

bool DriverCalls::setPosition(std::size_t axis, double position) {
  SetPosition service;
  service.request.position = position;
  const std::string name = kAxisNames.at(axis) + "/set_position";
  return call(requestOf(Kind::kSetPosition, 1U << axis, name + " " + shown(position)), name,
              service);
}

bool DriverCalls::setCurrent(std::size_t axis, double run, double hold) {
  SetCurrent service;
  service.request.run_current = run;
  service.request.hold_current = hold;
  const std::string name = kAxisNames.at(axis) + "/set_current";
  return call(requestOf(Kind::kOther, 1U << axis, name + " " + shown(run) + " " + shown(hold)),
              name, service);
}

bool DriverCalls::compareCam(std::size_t axis, double from, double to, double lead) {
  SetPositionCompare service;
  service.request.output = kComparedOutput;
  service.request.axis = kAxisNames.at(axis);
  service.request.cam_begin = {from};
  service.request.cam_end = {to};
  service.request.lead_on = lead;
  Request request = requestOf(
      Kind::kOther, 0,
      "set_position_compare " + kAxisNames.at(axis) + " from " + shown(from) + " to " + shown(to));
  request.compare.emplace();
  return call(std::move(request), "set_position_compare", service);
}

bool DriverCalls::comparePulses(const CompareOrder& order) {
  SetPositionCompare service;
  service.request.output = kComparedOutput;
  service.request.axis = kAxisNames.at(order.axis);
  service.request.direction = static_cast<std::int8_t>(order.direction);
  service.request.distance = order.distance;
  service.request.begin = order.begin;
  service.request.end = order.end;
  service.request.pulse = order.pulse;
  Request request =
      requestOf(Kind::kOther, 0,
                "set_position_compare " + kAxisNames.at(order.axis) + " each " +
                    shown(order.distance) + " from " + shown(order.begin) + " to " +
                    shown(order.end) + " in direction " + std::to_string(order.direction));
  request.compare = order;
  request.compare->has_pulses = true;
  return call(std::move(request), "set_position_compare", service);
}

bool DriverCalls::clearCompare() {
  SetPositionCompare service;
  service.request.output = kComparedOutput;
  Request request = requestOf(Kind::kOther, 0, "set_position_compare of no axis");
  request.compare.emplace();
  return call(std::move(request), "set_position_compare", service);
}

bool DriverCalls::speedOverride(double factor) {
  SpeedOverride service;
  service.request.factor = factor;
  return call(requestOf(Kind::kOther, kAllAxes, "speed_override " + shown(factor)),
              "speed_override", service);
}

bool DriverCalls::set(Kind kind, std::size_t axis, const std::string& service, bool data) {
  std_srvs::SetBool message;
  message.request.data = data;
  return call(requestOf(kind, 1U << axis, service + (data ? " true" : " false")), service, message);
}

bool DriverCalls::trigger(Kind kind, AxisSet axes, const std::string& service) {
  std_srvs::Trigger message;
  return call(requestOf(kind, axes, service), service, message);
}

}  // namespace stepdriver::storm
