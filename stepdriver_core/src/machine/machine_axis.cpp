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

std::vector<axis::HomingResult> homeInOrder(Shell& shell,
                                            const std::vector<std::unique_ptr<axis::Axis>>& all,
                                            const std::vector<AxisId>& wanted,
                                            const std::function<bool()>& cancelled) {
  std::map<int, std::vector<AxisId>> groups;
  for (const AxisId id : wanted) groups[all[id]->config().homing->order].push_back(id);
  const auto not_homed = [&](const std::vector<AxisId>& group, axis::HomingEnd end,
                             const std::string& why) {
    std::vector<axis::HomingResult> results;
    for (const AxisId id : group) {
      axis::HomingResult result;
      result.axis = all[id]->config().name;
      result.end = end;
      result.message = fmt::format("{} isn't homed: {}", result.axis, why);
      result.position = all[id]->state().position;
      results.push_back(std::move(result));
    }
    return results;
  };
  std::vector<axis::HomingResult> ended;
  for (const auto& [order, group] : groups) {
    const auto failed = std::find_if(
        ended.begin(), ended.end(),
        [](const axis::HomingResult& result) { return result.end != axis::HomingEnd::kHomed; });
    std::vector<axis::HomingResult> results;
    if (failed != ended.end()) {
      results = not_homed(group, failed->end, failed->axis + " comes before it, and isn't homed");
    } else if (ended.empty()) {
      results = homeTogether(shell, group, cancelled);
    } else {
      // Others have moved by now: if this one can't begin anymore, that is its result.
      try {
        results = homeTogether(shell, group, cancelled);
      } catch (const Refused& refused) {
        results = not_homed(group, axis::HomingEnd::kFailed, refused.what());
      }
    }
    ended.insert(ended.end(), results.begin(), results.end());
  }
  return ended;
}

}  // namespace stepdriver::machine

namespace stepdriver::axis {

activity::Reply Axis::Impl::ask(machine::Request request) const {
  return machine::ask(shell, std::move(request));
}

std::optional<MoveResult> Axis::Impl::result(const Move& move) const {
  if (move.outcome == nullptr) return std::nullopt;
  auto ended = move.outcome->get();
  if (ended) {
    shell.awaitTurn();
    return ended;
  }
  // Nobody waits until the chip answers.
  std::string why = shell.whyHung();
  if (why.empty()) return std::nullopt;
  MoveResult result;
  result.end = MoveEnd::kFault;
  result.message = std::move(why);
  result.position = shell.state(id).position;
  result.marks_known = false;
  return result;
}

void Axis::Impl::requireAccepted(const Move& move) const {
  if (move.outcome != nullptr) return;
  throw Refused(config.name + ": the move was only planned: it has no end to wait for");
}

std::optional<bool> Axis::Impl::endstopActive(bool at_max) const {
  std::optional<bool> active;
  for (std::size_t i = 0; i < config.motors(); ++i) {
    const config::MotorConfig& motor = config.motorAt(i);
    const motor::ChipLines& own = motor_lines.motorAt(i);
    const auto& endstop = at_max ? motor.endstop_max : motor.endstop_min;
    if (!endstop) continue;
    const int line = at_max ? own.endstop_max : own.endstop_min;
    const int level = lines.read(line);
    if (level < 0) {
      throw GpioError(config.name + ": " +
                      lineFailureText({-level, line, true}, config, motor_lines, names));
    }
    active = active.value_or(false) || (level != 0) == endstop->active_level;
  }
  return active;
}

Axis::Axis(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Axis::~Axis() = default;

const config::AxisConfig& Axis::config() const { return impl_->config; }

// ---- motions ----

Move Axis::moveTo(double position, bool relative, double velocity, bool shortest) {
  const auto reply = impl_->ask(machine::MoveTo{impl_->id, position, relative, velocity, shortest});
  return std::get<std::vector<Move>>(reply.value).front();
}

MovePlan Axis::plan(double position, bool relative, double velocity, bool shortest) {
  auto reply = impl_->ask(machine::PlanMove{{impl_->id, position, relative, velocity, shortest}});
  return std::get<MovePlan>(std::move(reply.value));
}

Move Axis::moveRounds(double rounds, double velocity) {
  const auto reply = impl_->ask(machine::MoveRounds{impl_->id, rounds, velocity});
  return std::get<std::vector<Move>>(reply.value).front();
}

MoveResult Axis::wait(const Move& move) {
  impl_->requireAccepted(move);
  std::optional<MoveResult> ended;
  impl_->shell.wait([&] {
    ended = impl_->result(move);
    return ended.has_value();
  });
  return *ended;
}

std::optional<MoveResult> Axis::result(const Move& move) const { return impl_->result(move); }

std::optional<MoveResult> Axis::waitFor(const Move& move, std::chrono::nanoseconds longest) {
  impl_->requireAccepted(move);
  std::optional<MoveResult> ended;
  const auto has_ended = [&] {
    ended = impl_->result(move);
    return ended.has_value();
  };
  impl_->shell.waitFor(has_ended, longest);
  return ended;
}

void Axis::jog(double velocity, std::optional<std::uint64_t> unless_stopped_since) {
  impl_->ask(machine::Jog{impl_->id, velocity, unless_stopped_since});
}

void Axis::setLimits(const AxisLimits& wanted) {
  impl_->ask(machine::SetLimits{impl_->id, wanted});
}

AxisLimits Axis::limits() const { return impl_->shell.snapshot()->axes.at(impl_->id).limits; }

void Axis::setCurrent(double run, double hold) {
  impl_->ask(machine::SetCurrent{impl_->id, run, hold});
}

void Axis::setStallThreshold(int threshold) {
  impl_->ask(machine::SetStallThreshold{impl_->id, threshold});
}

void Axis::stop() { impl_->ask(machine::StopAxis{impl_->id}); }

void Axis::stop(const Move& move) { impl_->ask(machine::StopMove{impl_->id, move.id}); }

// ---- homing ----

HomingResult Axis::home(const std::function<bool()>& cancelled) {
  return machine::homeTogether(impl_->shell, {impl_->id}, cancelled).front();
}

void Axis::checkHoming() const { impl_->ask(machine::Home{{impl_->id}, true}); }

// ---- the driver chip ----

void Axis::enable(bool on) { impl_->ask(machine::Enable{{impl_->id}, on}); }

void Axis::sleep(bool asleep) { impl_->ask(machine::Sleep{impl_->id, asleep}); }

void Axis::reset() { impl_->ask(machine::Reset{impl_->id}); }

void Axis::setMicrosteps(int microsteps) {
  impl_->ask(machine::SetMicrosteps{impl_->id, microsteps});
}

void Axis::setPosition(double position) { impl_->ask(machine::SetPosition{impl_->id, position}); }

// ---- state ----

AxisState Axis::state() const { return impl_->shell.state(impl_->id); }

double Axis::peakRate() const { return impl_->shell.peakRate(impl_->id); }

EndstopState Axis::endstops() const {
  return {impl_->endstopActive(false), impl_->endstopActive(true)};
}

}  // namespace stepdriver::axis
