#include "homing_to_flag.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "message_text.h"
#include "nanoseconds.h"

namespace stepdriver::activity {
namespace {

// An index that is nearer than this to the flag's edge may come before it or after it: then the
// trigger point jumps by a turn.
constexpr double kIndexMargin = 0.1;  // [turns]
// A switch that has not come to rest after this many debounce times is broken.
constexpr int kMostFlagDebounces = 50;
// How often the way since the flag is compared with a turn: no event tells of it.
constexpr pulse::Nanoseconds kIndexLookPeriod = 10'000'000;
// A kernel loses edges when its queue of events overflows, which is rare. One that reports none
// has no interrupt for this line.
constexpr int kMostFlagApproaches = 3;

using axis::HomingPhase;

DebouncedInput inputOf(const motor::SensorLine& line) {
  return {line.signal.line, line.signal.active, line.debounce};
}

}  // namespace

HomingToFlag::HomingToFlag(Context& context, axis::AxisModel& axis, std::uint64_t id,
                           std::shared_ptr<Result> outcome)
    : Homing(context, axis, id, std::move(outcome)),
      has_flag_(config_.kind != config::HomingKind::kIndex || !config_.flag.empty()),
      flag_name_(config_.flag.empty() ? config_.input : config_.flag),
      flag_(inputOf(config_.flag.empty() ? *axis.motor.lines().homing_input
                                         : *axis.motor.lines().homing_flag)) {
  axis_.motor.watchMotions();
}

// ---- the phases ----

void HomingToFlag::start() {
  flag_.begin(context());
  if (flag_.error() != 0) axis_.readInput(flag_.line());
  if (flag_.active()) return seek(HomingPhase::kLeaving, -towards_);
  if (!has_flag_) return seek(HomingPhase::kLatching, towards_);
  if (axis_.isStoppedAt(config_.at_max)) {
    returns_ = true;
    return seek(HomingPhase::kBackingOff, -towards_);
  }
  seek(HomingPhase::kSeeking, towards_);
}

void HomingToFlag::seek(HomingPhase phase, double direction) {
  enter(phase, direction);
  direction_ = direction;
  began_active_ = flag_.active();
  passed_.clear();
  goOn();
}

void HomingToFlag::goOn() {
  slowing_ = false;
  Goal goal;
  goal.target = bound();
  goal.velocity = phase() == HomingPhase::kLatching ? config_.latch_speed : config_.seek_speed;
  begin(std::move(goal));
}

void HomingToFlag::slowDown() {
  if (slowing_) return;
  slowing_ = true;
  stroke()->stop({axis::MoveEnd::kStopped, sensor() + " has changed"});
}

void HomingToFlag::observe() {
  if (!flag_.poll(context())) return;
  passed_.push_back({flag_.active(), placeAt(*flag_.changed()), flag_.changeWasRead()});
  const int direction = axis_.directionAtTime(context().motionTimeAt(*flag_.changed()));
  if (has_flag_ && direction != 0 && !flag_.changeWasRead()) {
    places_.at(direction, flag_.active()) = passed_.back().place;
  }
}

void HomingToFlag::look(bool stroke_has_ended) {
  const auto since = flag_.bouncesSince();
  const pulse::Nanoseconds debounce = flag_.debounce();
  if (since && context().now - *since > kMostFlagDebounces * debounce) {
    return failNow(fmt::format(
        "{} bounces without end: after {} it still hasn't been at rest for "
        "debounce_ms, {}",
        sensor(), millisecondsText(context().now - *since), millisecondsText(debounce)));
  }
  if (stroke_has_ended) {
    if (!since) settled();
    return;
  }
  switch (phase()) {
    case HomingPhase::kSeeking:
      if (!passed_.empty()) slowDown();
      return;
    case HomingPhase::kLeaving:
    case HomingPhase::kBackingOff:
      if (hasLeft()) slowDown();
      return;
    case HomingPhase::kLatching:
      if (hasLatched()) slowDown();
      return;
    default:
      return;
  }
}

bool HomingToFlag::hasLeft() const {
  return !flag_.active() && (began_active_ || !passed_.empty());
}

pulse::Nanoseconds HomingToFlag::lookDue() const {
  const bool awaits_index = config_.kind == config::HomingKind::kIndex && edge_ && !index_;
  return std::min(flag_.due(), awaits_index ? context().now + kIndexLookPeriod : pulse::kNever);
}

std::string HomingToFlag::unmet() const {
  const bool seeks_index =
      config_.kind == config::HomingKind::kIndex && phase() == HomingPhase::kLatching;
  if (seeks_index && (edge_ || !has_flag_)) {
    return fmt::format("the index {} didn't come", config_.input);
  }
  if (flag_.active()) return sensor() + " didn't become inactive";
  const bool again = phase() == HomingPhase::kLatching;
  return fmt::format("{} didn't become active{}", sensor(), again ? " again" : "");
}

// ---- the ends of strokes ----

void HomingToFlag::strokeEnded() {
  const axis::MoveEnd end = stroke()->result().end;
  if (end == axis::MoveEnd::kEndstopMin || end == axis::MoveEnd::kEndstopMax) {
    return metEndstop(end == axis::MoveEnd::kEndstopMax);
  }
  if (phase() == HomingPhase::kPullingOff) {
    keepPlaces();
    return succeed(trigger_, 0.0, indexWarning());
  }
  if (!slowing_) {
    return failNow(unmet() + " within max_travel, " + axis_.show(config_.max_travel));
  }
  endStroke();  // until the switch has come to rest too
  look(true);
}

void HomingToFlag::metEndstop(bool at_max) {
  const bool ahead = at_max == config_.at_max;
  if (phase() == HomingPhase::kSeeking && ahead) {
    returns_ = !slowing_;
    return seek(HomingPhase::kBackingOff, -towards_);
  }
  const std::string where = fmt::format("the {} endstop was met", at_max ? "max" : "min");
  if (phase() == HomingPhase::kBackingOff && !ahead && returns_ && passed_.empty()) {
    return failNow(fmt::format("{}, and {} didn't become active between the two", where, sensor()));
  }
  const std::string cause = phase() == HomingPhase::kPullingOff ? "" : ": " + unmet();
  failNow(fmt::format("{} while {}{}", where, nameOf(phase()), cause));
}

void HomingToFlag::settled() {
  switch (phase()) {
    case HomingPhase::kSeeking:
      returns_ = false;
      return seek(HomingPhase::kBackingOff, -towards_);
    case HomingPhase::kLeaving:
    case HomingPhase::kBackingOff:
      return hasLeft() ? seek(HomingPhase::kLatching, towards_) : goOn();
    default:
      return latched();
  }
}

// ---- the trigger point ----

double HomingToFlag::placeAt(pulse::Nanoseconds clock_time) const {
  return axis_.jointAtTime(context().motionTimeAt(clock_time));
}

double HomingToFlag::turn() const {
  return axis_.config.steps_per_round * axis_.motor.microsteps() / axis_.config.microsteps;
}

// An index pulse may be shorter than the time between two looks: its edge counts.
std::optional<HomingToFlag::Edge> HomingToFlag::indexEdge() const {
  const motor::SensorLine& index = *axis_.motor.lines().homing_input;
  for (const gpio::EdgeEvent& edge : axis_.inputs.since(index.signal.line, phaseBegan())) {
    if (edge.level != index.signal.active) continue;
    const double place = placeAt(edge.time_ns);
    if (!edge_ || towards_ * (place - *edge_) > 0.0) return Edge{true, place, false};
  }
  return std::nullopt;
}

bool HomingToFlag::hasLatched() {
  const bool to_centre = config_.kind == config::HomingKind::kFlagCentre;
  if (has_flag_ && !edge_ && !passed_.empty()) edge_ = passed_.front().place;
  if (to_centre) return passed_.size() >= 2;
  if (edgeWasLost()) return true;
  if (config_.kind != config::HomingKind::kIndex) return edge_.has_value();
  if (has_flag_ && !edge_) return false;
  if (const auto index = indexEdge()) {
    index_ = index->place;
    return true;
  }
  if (!edge_) return false;
  const double way = towards_ * (placeAt(context().now) - *edge_);
  if (way > (1.0 + kIndexMargin) * turn()) {
    failNow(fmt::format("the index {} didn't come within a turn of the edge of {}", config_.input,
                        sensor()));
  }
  return false;
}

bool HomingToFlag::edgeWasLost() const {
  const std::size_t counted = config_.kind == config::HomingKind::kFlagCentre ? 2 : 1;
  const auto end = passed_.begin() + static_cast<std::ptrdiff_t>(std::min(counted, passed_.size()));
  return has_flag_ &&
         std::any_of(passed_.begin(), end, [](const Edge& edge) { return edge.was_read; });
}

void HomingToFlag::approachAgain() {
  if (++approaches_ == kMostFlagApproaches) {
    return failNow(
        fmt::format("the kernel has reported no edge of {} when it changed, in {} approaches: "
                    "its place is only known to the time between two readings",
                    sensor(), kMostFlagApproaches));
  }
  edge_.reset();
  centre_.clear();
  // The middle's second latch ends where its first one begins.
  if (direction_ != towards_ && !flag_.active()) return seek(HomingPhase::kLatching, towards_);
  seek(HomingPhase::kBackingOff, -towards_);
}

void HomingToFlag::latched() {
  if (edgeWasLost()) return approachAgain();
  switch (config_.kind) {
    case config::HomingKind::kIndex:
      trigger_ = *index_;
      break;
    case config::HomingKind::kFlagCentre:
      for (const Edge& edge : passed_) {
        if (centre_.size() < 4) centre_.push_back(edge.place);
      }
      if (direction_ == towards_) return seek(HomingPhase::kLatching, -towards_);
      trigger_ = std::accumulate(centre_.begin(), centre_.end(), 0.0) / 4.0;
      break;
    default:
      trigger_ = *edge_;
  }
  pullOff(trigger_);
}

// What passes the flag later is compared with them.
void HomingToFlag::keepPlaces() {
  for (const int direction : {-1, 1}) {
    for (const bool active : {false, true}) {
      auto& place = places_.at(direction, active);
      if (place) *place = config_.offset + (*place - trigger_) / axis_.stepsPerUnit();
    }
  }
  axis_.flag_places = places_;
}

std::string HomingToFlag::indexWarning() const {
  if (!index_ || !edge_) return "";
  const double turns = std::abs(*index_ - *edge_) / turn();
  const double nearest = std::min(turns, std::abs(1.0 - turns));
  if (nearest >= kIndexMargin) return "";
  return fmt::format(
      ", but the index {} comes {:.0f} % of a turn from the edge of {}: it may be taken for the "
      "one a turn before or after it; turn the motor's shaft or move the flag by half a turn",
      config_.input, 100.0 * nearest, sensor());
}

}  // namespace stepdriver::activity
