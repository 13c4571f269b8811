#include "machine_axis.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string>
#include <utility>

#include "axis/line_failure.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {

activity::Reply ask(Shell& shell, Request request) {
  return valueOf(shell.call(std::move(request)));
}

activity::Reply valueOf(activity::Reply reply) {
  if (!reply.failure) return reply;
  switch (reply.failure->kind) {
    case activity::Failure::Kind::kRefused:
    case activity::Failure::Kind::kOutdated:
      throw Refused(reply.failure->text);
    case activity::Failure::Kind::kGpio:
      throw GpioError(reply.failure->text);
    case activity::Failure::Kind::kOther:
      break;
  }
  throw Error(reply.failure->text);
}

MachineAxis::MachineAxis(config::AxisConfig config, AxisId id, const motor::MotorLines& motor_lines,
                         Shell& shell, gpio::Lines& lines, const axis::LineNames& names)
    : config_(std::move(config)),
      id_(id),
      motor_lines_(motor_lines),
      shell_(shell),
      lines_(lines),
      names_(names) {}

// ---- motions ----

axis::Move MachineAxis::moveTo(double position, bool relative, double velocity, bool shortest) {
  const auto reply = ask(shell_, MoveTo{id_, position, relative, velocity, shortest});
  return std::get<std::vector<axis::Move>>(reply.value).front();
}

axis::MovePlan MachineAxis::plan(double position, bool relative, double velocity, bool shortest) {
  auto reply = ask(shell_, PlanMove{{id_, position, relative, velocity, shortest}});
  return std::get<axis::MovePlan>(std::move(reply.value));
}

axis::Move MachineAxis::moveRounds(double rounds, double velocity) {
  const auto reply = ask(shell_, MoveRounds{id_, rounds, velocity});
  return std::get<std::vector<axis::Move>>(reply.value).front();
}

std::optional<axis::MoveResult> MachineAxis::result(const axis::Move& move) const {
  if (move.outcome == nullptr) return std::nullopt;
  auto ended = move.outcome->get();
  if (ended) {
    shell_.awaitTurn();
    return ended;
  }
  // Nobody waits until the chip answers.
  std::string why = shell_.whyHung();
  if (why.empty()) return std::nullopt;
  return axis::MoveResult{axis::MoveEnd::kFault, std::move(why), state().position, 0.0};
}

axis::MoveResult MachineAxis::wait(const axis::Move& move) {
  requireAccepted(move);
  std::optional<axis::MoveResult> ended;
  shell_.wait([&] {
    ended = result(move);
    return ended.has_value();
  });
  return *ended;
}

std::optional<axis::MoveResult> MachineAxis::waitFor(const axis::Move& move,
                                                     std::chrono::nanoseconds longest) {
  requireAccepted(move);
  std::optional<axis::MoveResult> ended;
  const auto has_ended = [&] {
    ended = result(move);
    return ended.has_value();
  };
  shell_.waitFor(has_ended, longest);
  return ended;
}

void MachineAxis::requireAccepted(const axis::Move& move) const {
  if (move.outcome != nullptr) return;
  throw Refused(config().name + ": the move was only planned: it has no end to wait for");
}

void MachineAxis::jog(double velocity, std::optional<std::uint64_t> unless_stopped_since) {
  ask(shell_, Jog{id_, velocity, unless_stopped_since});
}

void MachineAxis::setLimits(const axis::AxisLimits& wanted) { ask(shell_, SetLimits{id_, wanted}); }

axis::AxisLimits MachineAxis::limits() const { return shell_.snapshot()->axes.at(id_).limits; }

void MachineAxis::setCurrent(double run, double hold) { ask(shell_, SetCurrent{id_, run, hold}); }

void MachineAxis::stop() { ask(shell_, StopAxis{id_}); }

void MachineAxis::stop(const axis::Move& move) { ask(shell_, StopMove{id_, move.id}); }

// ---- homing ----

axis::HomingResult MachineAxis::home(const std::function<bool()>& cancelled) {
  return homeTogether(shell_, {id_}, cancelled).front();
}

void MachineAxis::checkHoming() const { ask(shell_, Home{{id_}, true}); }

std::vector<axis::HomingResult> homeTogether(Shell& shell, const std::vector<AxisId>& axes,
                                             const std::function<bool()>& cancelled) {
  const auto reply = ask(shell, Home{axes, false});
  const auto& accepted = std::get<activity::AcceptedHoming>(reply.value);
  const auto is_over = [](const auto& outcome) { return outcome->get().has_value(); };
  bool cancelling = false;
  const auto over_or_cancelled = [&] {
    if (std::all_of(accepted.outcomes.begin(), accepted.outcomes.end(), is_over)) return true;
    return !cancelling && cancelled && cancelled();
  };
  shell.wait(over_or_cancelled, static_cast<bool>(cancelled));
  if (!std::all_of(accepted.outcomes.begin(), accepted.outcomes.end(), is_over)) {
    cancelling = true;
    ask(shell, CancelHoming{accepted.ids});
    shell.wait(over_or_cancelled);
  }
  shell.awaitTurn();
  std::vector<axis::HomingResult> results;
  results.reserve(accepted.outcomes.size());
  for (const auto& outcome : accepted.outcomes) results.push_back(*outcome->get());
  return results;
}

std::vector<axis::HomingResult> homeInOrder(Shell& shell, const std::vector<MachineAxis*>& axes,
                                            const std::function<bool()>& cancelled) {
  std::map<int, std::vector<AxisId>> groups;
  for (const MachineAxis* axis : axes) {
    groups[axis->config().homing->order].push_back(axis->id());
  }
  const auto not_homed = [&](const std::vector<AxisId>& group, axis::HomingEnd end,
                             const std::string& why) {
    std::vector<axis::HomingResult> results;
    for (const MachineAxis* axis : axes) {
      if (std::find(group.begin(), group.end(), axis->id()) == group.end()) continue;
      axis::HomingResult result;
      result.axis = axis->config().name;
      result.end = end;
      result.message = fmt::format("{} isn't homed: {}", result.axis, why);
      result.position = axis->state().position;
      results.push_back(std::move(result));
    }
    return results;
  };
  std::vector<axis::HomingResult> all;
  for (const auto& [order, group] : groups) {
    const auto failed = std::find_if(all.begin(), all.end(), [](const axis::HomingResult& result) {
      return result.end != axis::HomingEnd::kHomed;
    });
    std::vector<axis::HomingResult> results;
    if (failed != all.end()) {
      results = not_homed(group, failed->end, failed->axis + " comes before it, and isn't homed");
    } else if (all.empty()) {
      results = homeTogether(shell, group, cancelled);
    } else {
      // Others have moved by now: if this one can't begin anymore, that is its result.
      try {
        results = homeTogether(shell, group, cancelled);
      } catch (const Refused& refused) {
        results = not_homed(group, axis::HomingEnd::kFailed, refused.what());
      }
    }
    all.insert(all.end(), results.begin(), results.end());
  }
  return all;
}

// ---- the driver chip ----

void MachineAxis::enable(bool on) { ask(shell_, Enable{{id_}, on}); }

void MachineAxis::sleep(bool asleep) { ask(shell_, Sleep{id_, asleep}); }

void MachineAxis::reset() { ask(shell_, Reset{id_}); }

void MachineAxis::setMicrosteps(int microsteps) { ask(shell_, SetMicrosteps{id_, microsteps}); }

void MachineAxis::setPosition(double position) { ask(shell_, SetPosition{id_, position}); }

// ---- state ----

axis::AxisState MachineAxis::state() const { return shell_.state(id_); }

double MachineAxis::peakRate() const { return shell_.peakRate(id_); }

axis::EndstopState MachineAxis::endstops() const {
  return {endstopActive(false), endstopActive(true)};
}

std::optional<bool> MachineAxis::endstopActive(bool at_max) const {
  std::optional<bool> active;
  for (std::size_t i = 0; i < config_.motors(); ++i) {
    const config::MotorConfig& motor = config_.motorAt(i);
    const motor::ChipLines& own = motor_lines_.motorAt(i);
    const auto& endstop = at_max ? motor.endstop_max : motor.endstop_min;
    if (!endstop) continue;
    const int line = at_max ? own.endstop_max : own.endstop_min;
    const int level = lines_.read(line);
    if (level < 0) {
      throw GpioError(config_.name + ": " +
                      axis::lineFailureText({-level, line, true}, config_, motor_lines_, names_));
    }
    active = active.value_or(false) || (level != 0) == endstop->active_level;
  }
  return active;
}

}  // namespace stepdriver::machine
