#include "flag_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "message_text.h"
#include "motor/motor_lines.h"
#include "past_position.h"

namespace stepdriver::machine {
namespace {

// How often the way is compared with the places of the flag: no event tells that an edge is
// missing.
constexpr pulse::Nanoseconds kFlagLookPeriod = 10'000'000;
constexpr double kWholeTurn = 6.283185307179586;  // [rad]

std::size_t indexOf(int direction, bool active) {
  return (direction > 0 ? 2U : 0U) + (active ? 1U : 0U);
}

/// [unit] After how much of its way an axis passes the flag again.
double repeatOf(const axis::AxisModel& axis) {
  return axis.config.continuous ? kWholeTurn : std::numeric_limits<double>::infinity();
}

/// [unit] How far a place is beyond another one in a direction.
double beyond(const axis::AxisModel& axis, double place, double other, int direction) {
  const double apart =
      std::isinf(repeatOf(axis)) ? place - other : std::remainder(place - other, repeatOf(axis));
  return direction * apart;
}

std::string distanceText(const axis::AxisModel& axis, double distance) {
  const config::Kind kind = axis.config.kind;
  return fmt::format("{} {}", roughText(distance * config::configUnitsPerUnit(kind)),
                     kind == config::Kind::kLinear ? "mm" : "deg");
}

}  // namespace

FlagChecks::Check::Check(axis::AxisModel& checked, std::string its_flag,
                         activity::InputEdges its_edges, pulse::Nanoseconds its_debounce)
    : axis(&checked),
      flag(std::move(its_flag)),
      edges(its_edges),
      debounce(its_debounce),
      delay(its_debounce + activity::InputEdges::kLongestReport + kFlagLookPeriod) {}

FlagChecks::FlagChecks(const std::vector<std::unique_ptr<axis::AxisModel>>& axes) {
  for (const auto& axis : axes) {
    const auto& homing = axis->config.homing;
    if (!homing || homing->check_at_flag == config::FlagCheck::kNone) continue;
    const motor::MotorLines& lines = axis->motor.lines();
    const bool is_index = homing->kind == config::HomingKind::kIndex;
    const motor::SensorLine& flag = is_index ? *lines.homing_flag : *lines.homing_input;
    checks_.emplace_back(*axis, is_index ? homing->flag : homing->input,
                         activity::InputEdges(flag.signal.line, flag.signal.active, flag.debounce),
                         flag.debounce);
  }
}

std::vector<FlagChecks::Finding> FlagChecks::poll(
    const activity::Context& context,
    const std::function<bool(const axis::AxisModel&)>& is_homing) {
  std::vector<Finding> findings;
  for (Check& check : checks_) {
    const bool can_be = check.axis->position.isHomed() && !is_homing(*check.axis);
    if (!can_be) {
      turnOff(check);
    } else if (!check.is_on || check.microsteps != check.axis->motor.microsteps()) {
      turnOff(check);
      turnOn(context, check);
    } else {
      look(context, check, findings);
    }
  }
  return findings;
}

void FlagChecks::turnOn(const activity::Context& context, Check& check) {
  check.axis->motor.watchMotions();
  check.edges.begin(context);
  check.is_on = true;
  check.microsteps = check.axis->motor.microsteps();
  check.expected = {};
  check.edges_due = pulse::kNever;
  check.began = check.looked = check.watched_until = context.now;
}

void FlagChecks::turnOff(Check& check) {
  if (std::exchange(check.is_on, false)) check.axis->motor.unwatchMotions();
}

void FlagChecks::look(const activity::Context& context, Check& check,
                      std::vector<Finding>& findings) {
  if (check.axis->moving()) check.watched_until = context.now + 2 * check.delay;
  for (const activity::InputEdges::Edge& edge : check.edges.poll(context)) {
    judge(context, edge, check, findings);
  }
  const bool is_watched = context.now <= check.watched_until;
  if (is_watched && context.now >= check.looked + kFlagLookPeriod) {
    check.looked = context.now;
    lookForMissing(context, check, findings);
  }
  const pulse::Nanoseconds needed = check.looked + kFlagLookPeriod - check.delay + check.debounce;
  const bool must_know = is_watched && context.levels.edgesAddedUntil() < needed;
  check.edges_due = std::min(must_know ? needed : pulse::kNever, check.edges.edgesDue());
}

// Next to a reversal it can't be said at which side of the flag an edge is, and of an edge that the
// kernel has lost, it can't be said where it was.
void FlagChecks::judge(const activity::Context& context, const activity::InputEdges::Edge& edge,
                       Check& check, std::vector<Finding>& findings) {
  axis::AxisModel& axis = *check.axis;
  const int direction = axis.directionAtTime(context.motionTimeAt(edge.time));
  if (direction == 0 || edge.was_read) {
    check.expected = {};
    check.seen.fill(edge.time);
    return;
  }
  check.expected.at(indexOf(direction, edge.active)) = false;
  check.seen.at(indexOf(direction, edge.active)) = edge.time;
  const double place = positionAt(context, axis, edge.time);
  auto& known = axis.flag_places.at(direction, edge.active);
  if (!known) {
    known = place;
    return;
  }
  const double late = beyond(axis, place, *known, direction);
  if (std::abs(late) <= axis.config.homing->flag_tolerance) return;
  findings.push_back(
      {&axis, fmt::format("lost steps: the flag {} came {} {}", check.flag,
                          distanceText(axis, std::abs(late)), late < 0.0 ? "early" : "late")});
}

void FlagChecks::lookForMissing(const activity::Context& context, Check& check,
                                std::vector<Finding>& findings) {
  axis::AxisModel& axis = *check.axis;
  const double tolerance = axis.config.homing->flag_tolerance;
  const pulse::Nanoseconds time = context.now - check.delay;
  if (time < check.began) return;
  // An edge before that time may still have to be handed over.
  if (context.levels.edgesAddedUntil() < time + check.debounce) return;
  // It has changed, and what it has changed to isn't known yet.
  const auto changing = check.edges.changingSince();
  if (changing && context.now - *changing <= check.delay) return;
  const double place = positionAt(context, axis, time);
  for (const int direction : {-1, 1}) {
    for (const bool active : {false, true}) {
      const auto& known = axis.flag_places.at(direction, active);
      const std::size_t index = indexOf(direction, active);
      if (!known || time <= check.seen.at(index)) continue;
      bool& expected = check.expected.at(index);
      const double passed = beyond(axis, place, *known, direction);
      if (passed < -tolerance) {
        expected = check.edges.active() != active;
      } else if (passed > tolerance && std::exchange(expected, false) &&
                 passed < 0.25 * repeatOf(axis)) {
        findings.push_back({&axis, fmt::format("lost steps: the flag {} didn't come within {} of "
                                               "its place",
                                               check.flag, distanceText(axis, tolerance))});
      }
    }
  }
}

pulse::Nanoseconds FlagChecks::due() const {
  pulse::Nanoseconds due = pulse::kNever;
  for (const Check& check : checks_) {
    if (!check.is_on) continue;
    due = std::min(due, check.edges.due());
    const pulse::Nanoseconds next = check.looked + kFlagLookPeriod;
    if (check.axis->moving() || next <= check.watched_until) due = std::min(due, next);
  }
  return due;
}

pulse::Nanoseconds FlagChecks::edgesDue() const {
  pulse::Nanoseconds due = pulse::kNever;
  for (const Check& check : checks_) {
    if (check.is_on) due = std::min(due, check.edges_due);
  }
  return due;
}

bool FlagChecks::areWatched() const {
  return std::any_of(checks_.begin(), checks_.end(), [](const Check& check) {
    return check.is_on && (check.axis->moving() || check.edges_due != pulse::kNever ||
                           check.edges.changingSince());
  });
}

}  // namespace stepdriver::machine
