#include "driver_client.h"

#include <fmt/format.h>
#include <ros/transport_hints.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/Home.h>
#include <stepdriver/HomeAxes.h>
#include <stepdriver/Jog.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/SetOutput.h>
#include <stepdriver/SetPosition.h>
#include <stepdriver/SetPositionCompare.h>
#include <stepdriver/SpeedOverride.h>

#include <algorithm>
#include <chrono>
#include <exception>

#include "common/ask_service.h"

namespace stepdriver::console {
namespace {

constexpr std::uint32_t kQueued = 10;
// How many messages arrive in the driver's jog_timeout, so that a late one ends no jog.
constexpr double kMessagesInTimeout = 3.0;
constexpr double kLongestJogPeriod = 0.04;  // [s]

/// @param shown of a success, made from the numbers of the response.
template <typename Response>
client::Answer answerOf(const Response& response, const std::string& shown) {
  if (response.success == 0) return {false, response.message};
  return {true, shown};
}

client::Answer moveTo(const std::string& service, const MoveTo::Request& request, const Call& call,
                      const TableUnits& units) {
  const MoveTo::Response response = client::respondedBy<MoveTo>(service, request);
  return answerOf(
      response, moveText(call.axis, units, response.target, response.position, response.duration));
}

/// @param units of the call's axis.
client::Answer carryOutCall(const std::string& driver, const Call& call, const TableUnits& units) {
  const std::string axis = driver + "/" + (call.axis.empty() ? "" : call.axis + "/");
  switch (call.what) {
    case Call::What::kEnable:
    case Call::What::kDisable: {
      std_srvs::SetBool::Request request;
      request.data = call.what == Call::What::kEnable;
      return client::askService<std_srvs::SetBool>(axis + "enable", request);
    }
    case Call::What::kStep: {
      MoveTo::Request request;
      request.position = call.distance;
      request.relative = true;
      return moveTo(axis + "move_to", request, call, units);
    }
    case Call::What::kGoTo: {
      MoveTo::Request request;
      request.position = call.position;
      return moveTo(axis + "move_to", request, call, units);
    }
    case Call::What::kSetZero: {
      const auto response =
          client::respondedBy<SetPosition>(axis + "set_position", SetPosition::Request());
      return answerOf(response, fmt::format("{}: this position is {} from now on", call.axis,
                                            units.place(response.position)));
    }
    case Call::What::kHome: {
      Home::Request request;
      request.wait = true;
      const auto response = client::respondedBy<Home>(axis + "home", request);
      return answerOf(response, fmt::format("{} is homed and stands at {}", call.axis,
                                            units.place(response.position)));
    }
    case Call::What::kHomeAll: {
      HomeAxes::Request request;
      request.wait = true;
      return client::askService<HomeAxes>(driver + "/home", request);
    }
    case Call::What::kSetOutput: {
      SetOutput::Request request;
      request.name = call.output;
      request.on = call.on;
      return client::askService<SetOutput>(driver + "/set_output", request);
    }
    case Call::What::kEndCompare: {
      SetPositionCompare::Request request;
      request.output = call.output;
      return client::askService<SetPositionCompare>(driver + "/set_position_compare", request);
    }
    case Call::What::kHold:
      return client::askService<std_srvs::Trigger>(driver + "/hold");
    case Call::What::kResume:
      return client::askService<std_srvs::Trigger>(driver + "/resume");
    case Call::What::kSpeedOverride: {
      SpeedOverride::Request request;
      request.factor = call.factor;
      const auto response = client::respondedBy<SpeedOverride>(driver + "/speed_override", request);
      return answerOf(response, fmt::format("all axes move at {:.0f} % of the commanded speed",
                                            call.factor * 100.0));
    }
    case Call::What::kStop:
      return client::askService<std_srvs::Trigger>(driver + "/stop");
    case Call::What::kRecover:
      break;
  }
  return client::askService<std_srvs::Trigger>(driver + "/recover");
}

}  // namespace

DriverClient::DriverClient(ros::NodeHandle node, Session& session,
                           const DriverParameters& parameters)
    : session_(session),
      node_(node),
      driver_(session.driverName()),
      emergency_stop_(driver_ + "/emergency_stop"),
      jog_(node.advertise<Jog>(driver_ + "/jog", 1)) {
  configure(parameters);
  const auto hints = ros::TransportHints().tcpNoDelay();
  states_ = node.subscribe<AxisStates>(
      driver_ + "/axis_states", kQueued,
      [this](const AxisStates::ConstPtr& message) { onMessage(*message); }, {}, hints);
  endstops_ = node.subscribe<Endstops>(
      driver_ + "/endstops", kQueued,
      [this](const Endstops::ConstPtr& message) { onMessage(*message); }, {}, hints);
  io_ = node.subscribe<IoStates>(
      driver_ + "/io_states", kQueued,
      [this](const IoStates::ConstPtr& message) { onMessage(*message); }, {}, hints);
  log_ = node.subscribe<rosgraph_msgs::Log>(
      "/rosout", 10 * kQueued,
      [this](const rosgraph_msgs::Log::ConstPtr& message) { onMessage(*message); });
}

void DriverClient::carryOut(const Orders& orders) {
  if (orders.emergency_stop) emergency_stop_.press();
  publish(orders.jogs);
  for (const Call& call : orders.calls) start(call);
}

void DriverClient::publish(const std::vector<HeldJog::Order>& jogs) {
  // One after the other: an axis that is named twice in a message is refused.
  for (const HeldJog::Order& order : jogs) {
    Jog message;
    message.header.stamp = ros::Time::now();
    message.name.push_back(order.axis);
    message.velocity.push_back(order.velocity / unitsOf(order.axis));
    jog_.publish(message);
  }
}

void DriverClient::start(const Call& call) {
  auto& lane = lanes_[call.name()];
  if (!lane) lane = std::make_unique<Lane>();
  lane->call = call;
  lane->background.start([driver = driver_, call, units = tableUnitsOf(call.axis)] {
    return carryOutCall(driver, call, units);
  });
}

void DriverClient::poll() {
  if (const auto answer = emergency_stop_.takeAnswer()) {
    session_.emergencyAnswered(answer->success, answer->message);
  }
  for (const auto& [name, lane] : lanes_) {
    const auto answer = lane->background.takeAnswer();
    if (answer) session_.answered(lane->call, answer->success, answer->message);
  }
  if (!parameters_.valid()) noticeTheDriver();
  takeParameters();
}

void DriverClient::noticeTheDriver() {
  const bool live = session_.driver().live(steadyNow());
  if (live == was_live_) return;
  was_live_ = live;
  if (!live) {
    session_.driver().forgetEvents();
    session_.messages().say("no state of " + driver_ + " arrives any more");
    return;
  }
  // It may be another driver by now, or have been started with other parameters.
  parameters_ = std::async(std::launch::async, readDriverParameters, driver_);
}

void DriverClient::takeParameters() {
  if (!parameters_.valid() ||
      parameters_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    return;
  }
  try {
    configure(parameters_.get());
  } catch (const std::exception& error) {
    session_.messages().say(std::string("the driver's parameters can't be read: ") + error.what());
  }
}

void DriverClient::configure(const DriverParameters& parameters) {
  session_.driver().configure(parameters.axes);
  chips_.clear();
  for (const config::AxisConfig& axis : parameters.axes) {
    if (!axis.hasTmc()) continue;
    chips_.push_back(node_.subscribe<DriverState>(
        driver_ + "/" + axis.name + "/driver", kQueued,
        [this, name = axis.name](const DriverState::ConstPtr& message) {
          onMessage(name, *message);
        }));
  }
  session_.jog().setPeriod(
      std::min(parameters.jog_timeout / kMessagesInTimeout, kLongestJogPeriod));
}

double DriverClient::unitsOf(const std::string& axis) const {
  const config::AxisConfig* config = session_.driver().config(axis);
  return config == nullptr ? 1.0 : config::configUnitsPerUnit(config->kind);
}

TableUnits DriverClient::tableUnitsOf(const std::string& axis) const {
  const config::AxisConfig* config = session_.driver().config(axis);
  if (config == nullptr) return {};
  return {config::configUnitsPerUnit(config->kind), configUnitOf(config->kind)};
}

void DriverClient::onMessage(const AxisStates& states) {
  std::vector<AxisView> axes;
  for (std::size_t i = 0; i < states.name.size(); ++i) {
    AxisView& axis = axes.emplace_back();
    axis.name = states.name[i];
    axis.enabled = states.enabled[i] != 0;
    axis.powered = states.powered[i] != 0;
    axis.asleep = states.asleep[i] != 0;
    axis.idle = states.idle[i] != 0;
    axis.moving = states.moving[i] != 0;
    axis.held = states.held[i] != 0;
    axis.homed = states.homed[i] != 0;
    axis.position_valid = states.position_valid[i] != 0;
    axis.microsteps = states.microsteps[i];
    axis.position = states.position[i] * unitsOf(axis.name);
    axis.velocity = states.velocity[i] * unitsOf(axis.name);
    axis.speed_override = states.speed_override;
    axis.fault = states.fault[i];
    axis.position_note = states.position_note[i];
  }
  session_.update(std::move(axes), steadyNow());
}

void DriverClient::onMessage(const Endstops& endstops) {
  for (std::size_t i = 0; i < endstops.name.size(); ++i) {
    session_.driver().updateEndstops(endstops.name[i], endstops.min[i] != 0, endstops.max[i] != 0);
  }
}

void DriverClient::onMessage(const IoStates& states) {
  const double to_steady = steadyNow() - ros::Time::now().toSec();
  const auto changed = [to_steady](const ros::Time& stamp) {
    return stamp.isZero() ? std::optional<double>() : stamp.toSec() + to_steady;
  };
  std::vector<OutputView> outputs;
  for (std::size_t i = 0; i < states.output_name.size(); ++i) {
    outputs.push_back({states.output_name[i], states.output_on[i] != 0,
                       changed(states.output_changed[i]), states.output_note[i],
                       states.output_error[i], states.output_axis[i], states.output_compared[i],
                       states.output_missed[i], states.output_value[i]});
  }
  std::vector<InputView> inputs;
  for (std::size_t i = 0; i < states.input_name.size(); ++i) {
    inputs.push_back({states.input_name[i], states.input_active[i] != 0,
                      changed(states.input_changed[i]), states.input_error[i]});
  }
  session_.driver().updateIo(std::move(outputs), std::move(inputs));
}

void DriverClient::onMessage(const std::string& axis, const DriverState& chips) {
  std::string text;
  for (std::size_t i = 0; i < chips.motor.size(); ++i) {
    text += text.empty() ? "" : "; ";
    if (!chips.motor[i].empty()) text += chips.motor[i] + ": ";
    if (chips.set_up[i] == 0) {
      text += "not set up";
      continue;
    }
    text += fmt::format("{:.2f} A of {:.2f} A, {}", chips.present_current[i], chips.run_current[i],
                        chips.at_least_celsius[i] > 0
                            ? fmt::format("above {} C", chips.at_least_celsius[i])
                            : "below 120 C");
    if (chips.temperature_warning[i] != 0) text += ", HOT";
    if (chips.load[i] >= 0.0) text += fmt::format(", load {:.0f} %", 100.0 * chips.load[i]);
  }
  session_.driver().updateChips(axis, text);
}

// Jogs have no answer: only the driver's log says why one was refused.
void DriverClient::onMessage(const rosgraph_msgs::Log& log) {
  if (log.name != driver_ || log.level < rosgraph_msgs::Log::WARN) return;
  session_.logged(log.msg);
}

double steadyNow() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace stepdriver::console
