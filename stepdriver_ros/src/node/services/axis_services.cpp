#include "axis_services.h"

#include <fmt/format.h>

#include "common/place_text.h"
#include "common/text.h"
#include "respond.h"

namespace stepdriver::ros_node {
namespace {

/// The differences, in words: "max_speed 0.05 m/s instead of 0.1 m/s".
std::string changesText(const axis::AxisLimits& before, const axis::AxisLimits& now,
                        const std::string& unit) {
  std::string text;
  const auto compare = [&](const char* what, double was, double is, const char* per) {
    if (was == is) return;
    const auto shown = [&](double value) {
      return value > 0.0 ? fmt::format("{} {}{}", roundedText(value), unit, per) : "none";
    };
    text +=
        fmt::format("{}{} {} instead of {}", text.empty() ? "" : ", ", what, shown(is), shown(was));
  };
  compare("max_speed", before.max_speed, now.max_speed, "/s");
  compare("acceleration", before.acceleration, now.acceleration, "/s^2");
  compare("deceleration", before.deceleration, now.deceleration, "/s^2");
  compare("jerk", before.jerk, now.jerk, "/s^3");
  return text.empty() ? "no limit has changed" : text;
}

/// "0.795 A in motion, 0.398 A at rest", for each motor if there are several.
std::string currentsText(const axis::AxisState& state) {
  std::string text;
  if (!state.drivers) return text;
  for (const driver::DriverState& driver : *state.drivers) {
    text += fmt::format("{}{}{} A in motion, {} A at rest", text.empty() ? "" : "; ",
                        driver.motor.empty() ? "" : driver.motor + " ",
                        roundedText(driver.run_current), roundedText(driver.hold_current));
  }
  return text;
}

}  // namespace

template <typename Service>
void AxisServices::advertise(const std::string& name, Handler<Service> handler,
                             ros::CallbackQueue& queue) {
  node_.setCallbackQueue(&queue);
  servers_.push_back(node_.advertiseService(name, handler, this));
}

AxisServices::AxisServices(const ros::NodeHandle& node, std::size_t index, axis::Axis& axis,
                           CallQueues& queues)
    : axis_(axis), node_(node, axis.config().name) {
  ros::CallbackQueue& own = queues.ofAxis(index);
  advertise<MoveTo>("move_to", &AxisServices::moveTo, own);
  advertise<MoveRounds>("move_rounds", &AxisServices::moveRounds, own);
  advertise<Plan>("plan", &AxisServices::plan, own);
  advertise<Microstep>("microstep", &AxisServices::microstep, own);
  advertise<SetLimits>("set_limits", &AxisServices::setLimits, own);
  advertise<SetCurrent>("set_current", &AxisServices::setCurrent, own);
  advertise<SetStallThreshold>("set_stall_threshold", &AxisServices::setStallThreshold, own);
  advertise<SetPosition>("set_position", &AxisServices::setPosition, own);
  advertise<std_srvs::SetBool>("enable", &AxisServices::enable, queues.power(index));
  advertise<std_srvs::SetBool>("sleep", &AxisServices::sleep, own);
  advertise<std_srvs::Trigger>("reset", &AxisServices::reset, own);
  // The queues outlive this, and the axis outlives them.
  queues.stops().advertise(
      node_.resolveName("stop"),
      [&axis](std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
        return respond(response, [&] {
          axis.stop();
          response.message = axis.config().name + ": stops";
        });
      });
}

bool AxisServices::moveTo(MoveTo::Request& request, MoveTo::Response& response) {
  response.target = response.position = axis_.state().position;
  return respond(response, [&] {
    const axis::Move move = axis_.moveTo(request.position, request.relative != 0, request.velocity,
                                         request.shortest != 0);
    respondToMove(move, request.wait != 0, response);
  });
}

bool AxisServices::moveRounds(MoveRounds::Request& request, MoveRounds::Response& response) {
  response.target = response.position = axis_.state().position;
  return respond(response, [&] {
    const axis::Move move = axis_.moveRounds(request.rounds, request.velocity);
    respondToMove(move, request.wait != 0, response);
  });
}

bool AxisServices::plan(Plan::Request& request, Plan::Response& response) {
  response.position = axis_.state().position;
  return respond(response, [&] {
    const axis::MovePlan planned = axis_.plan(request.position, request.relative != 0,
                                              request.velocity, request.shortest != 0);
    response.position = planned.move.target;
    response.duration = planned.move.duration;
    response.overshoot = planned.move.overshoot;
    response.steps_per_unit = planned.steps_per_unit;
    response.message = moveText("would move", planned.move);
    for (const axis::MovePiece& piece : planned.pieces) {
      response.pieces.emplace_back();
      Piece& shown = response.pieces.back();
      shown.duration = piece.duration;
      shown.position = piece.position;
      shown.velocity = piece.velocity;
      shown.acceleration = piece.acceleration;
      shown.jerk = piece.jerk;
    }
    for (const axis::MotionPart& part : planned.parts) {
      response.shaper_parts.push_back(part.part);
      response.shaper_delays.push_back(part.delay);
    }
    for (const config::ShaperConfig& shaper : axis_.config().input_shaper) {
      response.ringing_frequencies.push_back(shaper.frequency);
      response.ringing_dampings.push_back(shaper.damping);
    }
  });
}

double AxisServices::stepsPerUnit() const {
  const config::AxisConfig& config = axis_.config();
  return config.steps_per_unit * axis_.state().microsteps / config.microsteps;
}

std::string AxisServices::placeText(double position) const {
  return config::placeText(position, axis_.config().kind, stepsPerUnit());
}

std::string AxisServices::moveText(const char* moves, const axis::Move& move) const {
  const std::string target = placeText(move.target);
  const std::string rest = placeText(move.rest);
  const std::string& name = axis_.config().name;
  if (move.duration == 0.0) return fmt::format("{}: is already at {}", name, rest);
  std::string text =
      fmt::format("{}: {} to {} in {} s", name, moves, target, durationText(move.duration));
  if (rest != target) text += fmt::format("; it comes to rest at {}, the nearest microstep", rest);
  if (move.overshoot > 0.0) {
    text += fmt::format("; it can't stop before that, overshoots by {}, and comes back",
                        config::distanceText(move.overshoot, axis_.config().kind, stepsPerUnit()));
  }
  return text;
}

template <typename Response>
void AxisServices::respondToMove(const axis::Move& move, bool wait, Response& response) {
  response.target = move.target;
  if (!wait) {
    response.position = move.rest;
    response.duration = move.duration;
    response.message = moveText("moves", move);
    return;
  }
  const axis::MoveResult result = axis_.wait(move);
  response.success = result.end == axis::MoveEnd::kReached;
  response.message = result.message;
  response.position = result.position;
  response.duration = result.duration;
}

bool AxisServices::microstep(Microstep::Request& request, Microstep::Response& response) {
  respond(response, [&] {
    axis_.setMicrosteps(request.microsteps);
    response.message =
        fmt::format("{}: makes {} {} per full step", axis_.config().name, request.microsteps,
                    request.microsteps == 1 ? "microstep" : "microsteps");
  });
  response.microsteps = axis_.state().microsteps;
  return true;
}

bool AxisServices::setLimits(SetLimits::Request& request, SetLimits::Response& response) {
  respond(response, [&] {
    const axis::AxisLimits before = axis_.limits();
    axis_.setLimits({request.max_speed, request.acceleration, request.deceleration, request.jerk});
    response.message =
        fmt::format("{}: {}", axis_.config().name,
                    changesText(before, axis_.limits(), config::unitOf(axis_.config().kind)));
  });
  const axis::AxisLimits holding = axis_.limits();
  response.max_speed = holding.max_speed;
  response.acceleration = holding.acceleration;
  response.deceleration = holding.deceleration;
  response.jerk = holding.jerk;
  return true;
}

bool AxisServices::setCurrent(SetCurrent::Request& request, SetCurrent::Response& response) {
  respond(response, [&] {
    axis_.setCurrent(request.run_current, request.hold_current);
    response.message = axis_.config().name + ": " + currentsText(axis_.state());
  });
  const auto drivers = axis_.state().drivers;
  if (drivers && !drivers->empty()) {
    response.run_current = drivers->front().run_current;
    response.hold_current = drivers->front().hold_current;
  }
  return true;
}

bool AxisServices::setStallThreshold(SetStallThreshold::Request& request,
                                     SetStallThreshold::Response& response) {
  return respond(response, [&] {
    axis_.setStallThreshold(request.threshold);
    response.message = axis_.config().name + ": a stall at " + std::to_string(request.threshold);
  });
}

bool AxisServices::setPosition(SetPosition::Request& request, SetPosition::Response& response) {
  respond(response, [&] {
    axis_.setPosition(request.position);
    response.message =
        fmt::format("{}: stands at {}", axis_.config().name, placeText(request.position));
  });
  response.position = axis_.state().position;
  return true;
}

bool AxisServices::enable(std_srvs::SetBool::Request& request,
                          std_srvs::SetBool::Response& response) {
  return respond(response, [&] {
    axis_.enable(request.data != 0);
    response.message = axis_.config().name + (request.data ? ": enabled" : ": disabled");
  });
}

bool AxisServices::sleep(std_srvs::SetBool::Request& request,
                         std_srvs::SetBool::Response& response) {
  return respond(response, [&] {
    axis_.sleep(request.data != 0);
    response.message = axis_.config().name + (request.data ? ": asleep" : ": awake");
  });
}

bool AxisServices::reset(std_srvs::Trigger::Request& /*request*/,
                         std_srvs::Trigger::Response& response) {
  return respond(response, [&] {
    axis_.reset();
    response.message = axis_.config().name + ": reset";
  });
}

}  // namespace stepdriver::ros_node
