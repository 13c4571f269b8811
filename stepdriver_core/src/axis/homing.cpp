#include "homing.h"

#include <algorithm>
#include <cmath>

#include "message_text.h"

namespace stepdriver::axis {
namespace {

using Lock = std::lock_guard<std::mutex>;

// A switch that has not come to rest after so many debounce times is broken.
constexpr int kMostDebounces = 50;

pulse::Nanoseconds nanoseconds(double seconds) { return std::llround(seconds * 1e9); }

}  // namespace

const char* nameOf(HomingPhase phase) {
  switch (phase) {
    case HomingPhase::kNone:
      return "none";
    case HomingPhase::kLeaving:
      return "leaving";
    case HomingPhase::kSeeking:
      return "seeking";
    case HomingPhase::kBackingOff:
      return "backing off";
    case HomingPhase::kLatching:
      return "latching";
    case HomingPhase::kPullingOff:
      return "pulling off";
    case HomingPhase::kStopping:
      return "stopping";
  }
  return "";
}

Homing::Homing(Axis::Impl& axis)
    : axis_(axis),
      config_(axis.homingConfig()),
      endstop_(config_.at_max ? axis.config.endstop_max : axis.config.endstop_min),
      line_(config_.at_max ? axis.axis_lines.endstop_max : axis.axis_lines.endstop_min),
      towards_(config_.at_max ? 1.0 : -1.0),
      switch_(config_.at_max ? "the max switch" : "the min switch"),
      debounce_(nanoseconds(config_.debounce)) {
  const Lock lock(axis_.mutex);
  refuseUnlessReady(axis_);
  axis_.homing = this;
}

Homing::~Homing() {
  const Lock lock(axis_.mutex);
  axis_.homing = nullptr;
}

void Homing::refuseUnlessReady(Axis::Impl& axis) {
  axis.homingConfig();
  axis.refuseUnlessReadyToMove();
  axis.refuseWhileMoving("it is homed");
}

std::vector<HomingResult> Homing::run(const std::vector<std::unique_ptr<Homing>>& homings,
                                      const std::function<bool()>& cancelled) {
  const auto is_due = [](const auto& homing) { return homing->isDue(); };
  const auto is_over = [](const auto& homing) { return homing->isOver(); };
  bool to_cancel = false;
  while (!std::all_of(homings.begin(), homings.end(), is_over)) {
    for (const auto& homing : homings) {
      if (to_cancel) homing->cancel();
      homing->advance();
    }
    homings.front()->axis_.driver.waitFor([&] {
      to_cancel = to_cancel || (cancelled && cancelled());
      return std::any_of(homings.begin(), homings.end(), is_due) ||
             std::all_of(homings.begin(), homings.end(), is_over) ||
             (to_cancel && !homings.front()->cancelled_);
    });
  }
  std::vector<HomingResult> results;
  results.reserve(homings.size());
  for (const auto& homing : homings) results.push_back(homing->result_);
  return results;
}

bool Homing::isOver() {
  const Lock lock(axis_.mutex);
  return over_;
}

bool Homing::isDue() {
  const Lock lock(axis_.mutex);
  if (over_) return false;
  const pulse::ChannelState channel = axis_.harvest();
  if (phase_ == HomingPhase::kStopping) return channel.following == 0 || isReplaced();
  if (cancelled_ || !interrupted_.empty() || !axis_.fault.empty()) return true;
  if (isHeld()) return false;
  if (stroke_ == 0 || axis_.log.result(stroke_) || isReplaced()) return true;
  if (now() >= deadline_) return true;
  // A line that can't be read is something to do too.
  return leaves() && !slowing_ && (axis_.lines.read(line_) != 0) != endstop_->active_level;
}

void Homing::cancel() {
  const Lock lock(axis_.mutex);
  cancelled_ = true;
}

void Homing::interrupt(const std::string& why) {
  if (interrupted_.empty()) interrupted_ = why;
}

void Homing::hold() {
  if (!isHeld()) held_since_ = now();
}

void Homing::goOn() {
  if (!isHeld()) return;
  deadline_ += now() - *held_since_;
  held_since_.reset();
}

void Homing::advance() {
  const Lock lock(axis_.mutex);
  if (over_) return;
  try {
    step();
  } catch (const Error& error) {
    fail(error.what());
  }
}

void Homing::step() {
  const pulse::ChannelState channel = axis_.harvest();
  if (isReplaced()) {
    fail("another command took over");
    return finish(failure_);
  }
  if (phase_ == HomingPhase::kStopping) {
    if (channel.following == 0) finish(failure_ + "; it stands at ");
    return;
  }
  if (!interrupted_.empty()) return fail(interrupted_);
  if (!axis_.fault.empty()) return fail(axis_.fault);
  if (cancelled_) return fail("it was cancelled", HomingEnd::kCancelled);
  if (isHeld()) return;
  if (stroke_ == 0) {
    axis_.homed = false;
    deadline_ = now() + nanoseconds(config_.timeout);
    return enter(isClosed() ? HomingPhase::kLeaving : HomingPhase::kSeeking);
  }
  if (now() >= deadline_) return fail(timeOver());
  if (const auto result = axis_.log.result(stroke_)) {
    strokeEnded(result->end, channel);
  } else {
    underWay();
  }
}

// ---- strokes ----

bool Homing::leaves() const {
  return !settling_ && (phase_ == HomingPhase::kLeaving || phase_ == HomingPhase::kBackingOff);
}

void Homing::underWay() {
  if (!leaves() || slowing_ || isClosed()) return;
  slowing_ = true;
  axis_.slowDown(switch_ + " opened");
}

void Homing::strokeEnded(MoveEnd end, const pulse::ChannelState& channel) {
  const MoveEnd own = config_.at_max ? MoveEnd::kEndstopMax : MoveEnd::kEndstopMin;
  if (end == MoveEnd::kReached || end == MoveEnd::kStopped) return rested();
  if (end != own) {
    return fail(std::string("the ") + (config_.at_max ? "min" : "max") + " endstop was met while " +
                nameOf(phase_));
  }
  if (phase_ == HomingPhase::kLatching) keepCourse(channel);
  settle();
}

void Homing::rested() {
  if (settling_) return sample();
  const std::string travel = " within max_travel, " + axis_.show(config_.max_travel);
  switch (phase_) {
    case HomingPhase::kLeaving:
    case HomingPhase::kBackingOff:
      if (slowing_) return settle();
      return fail(switch_ + " didn't open" + travel);
    case HomingPhase::kSeeking:
      return fail(switch_ + " didn't close" + travel);
    case HomingPhase::kLatching:
      return fail(switch_ + " didn't close again" + travel);
    default:
      return succeed();
  }
}

void Homing::enter(HomingPhase phase) {
  phase_ = phase;
  phase_began_ = now();
  const double direction = leaves() ? -towards_ : towards_;
  bound_ = axis_.jointCount() + std::llround(direction * config_.max_travel * axis_.stepsPerUnit());
  resume();
}

void Homing::resume() {
  slowing_ = false;
  slipped_before_ = slipped();
  stroke(bound_, phase_ == HomingPhase::kSeeking ? config_.seek_speed : config_.latch_speed);
}

void Homing::stroke(std::int64_t target, double speed) {
  axis_.refuseUnlessReadyToMove();
  stroke_ = axis_.startMove(target, speed).id;
}

// ---- the switch ----

void Homing::settle() {
  settling_ = true;
  closed_ = isClosed();
  settle_began_ = steady_since_ = now();
  sample();
}

void Homing::sample() {
  const bool closed = isClosed();
  if (closed != closed_) steady_since_ = now();
  closed_ = closed;
  for (const gpio::EdgeEvent& edge : axis_.edges.since(line_, steady_since_)) {
    steady_since_ = std::max(steady_since_, edge.time_ns);
  }
  if (now() - steady_since_ >= debounce_) return settled();
  if (now() - settle_began_ > kMostDebounces * debounce_) {
    return fail(switch_ + " bounces without end: after " +
                Axis::Impl::inMilliseconds(now() - settle_began_) +
                " it still hasn't been at rest for debounce_ms, " +
                Axis::Impl::inMilliseconds(debounce_));
  }
  stroke(axis_.jointCount(), config_.latch_speed);
}

// What did not last is a glitch: the phase goes on.
void Homing::settled() {
  settling_ = false;
  switch (phase_) {
    case HomingPhase::kLeaving:
      return closed_ ? resume() : enter(HomingPhase::kSeeking);
    case HomingPhase::kSeeking:
      return closed_ ? enter(HomingPhase::kBackingOff) : resume();
    case HomingPhase::kBackingOff:
      return closed_ ? resume() : enter(HomingPhase::kLatching);
    default:
      return closed_ ? pullOff() : resume();
  }
}

// ---- the trigger point ----

void Homing::keepCourse(const pulse::ChannelState& channel) {
  latched_ = channel;
  slipped_ = slipped();
  course_.reset();
  if (const Motion* motion = axis_.log.find(channel.ended)) course_ = *motion->profile;
}

// The first edge of the burst that ended the latch: a contact that closes may bounce while the axis
// still makes steps.
std::optional<std::int64_t> Homing::triggerEdge() const {
  const std::int64_t end = latched_.end_time + slipped_;
  std::optional<std::int64_t> first;
  const auto edges = axis_.edges.since(line_, phase_began_);
  for (auto edge = edges.rbegin(); edge != edges.rend(); ++edge) {
    if (edge->level != endstop_->active_level || edge->time_ns > end) continue;
    if (first && *first - edge->time_ns > debounce_) break;
    first = edge->time_ns;
  }
  return first;
}

double Homing::triggerCount() const {
  const auto slack = static_cast<double>(latched_.slack);
  const double count = towards_ * static_cast<double>(latched_.count);
  const auto edge = triggerEdge();
  // An edge may be lost. The switch has closed between the last step and the one that wasn't made.
  if (!edge || !course_) return towards_ * count - slack;
  double at = towards_ * course_->stateAt(*edge - slipped_).position.value();
  at = std::min(at, count + 0.5);
  // When in the latch the timeline slid isn't known; by how many steps it could matter is.
  if (slipped_ != slipped_before_) at = std::max(at, count - 0.5);
  return towards_ * at - slack;
}

void Homing::pullOff() {
  trigger_ = triggerCount();
  phase_ = HomingPhase::kPullingOff;
  stroke(std::llround(trigger_ - towards_ * config_.pull_off * axis_.stepsPerUnit()),
         config_.seek_speed);
}

// ---- the end ----

std::string Homing::timeOver() const {
  const std::string within = " within timeout_s, " + numberText(config_.timeout) + " s";
  if (phase_ == HomingPhase::kPullingOff) return "it didn't come to its end" + within;
  const bool leaving = phase_ == HomingPhase::kLeaving || phase_ == HomingPhase::kBackingOff;
  return switch_ + (leaving ? " didn't open" : " didn't close") + within;
}

void Homing::fail(const std::string& why, HomingEnd end) {
  if (phase_ == HomingPhase::kStopping) return;
  phase_ = HomingPhase::kStopping;
  failure_ = axis_.config.name + " isn't homed: " + why;
  result_.end = end;
  if (!isReplaced()) axis_.slowDown(why);
}

void Homing::succeed() {
  axis_.origin = config_.offset - trigger_ / axis_.stepsPerUnit();
  axis_.homed = true;
  axis_.position_valid = true;
  result_.end = HomingEnd::kHomed;
  finish(axis_.config.name + " is homed, and stands at ");
}

void Homing::finish(const std::string& message) {
  result_.axis = axis_.config.name;
  result_.position = axis_.position();
  result_.message = message;
  if (!isReplaced()) result_.message += axis_.show(result_.position);
  over_ = true;
  phase_ = HomingPhase::kNone;
}

}  // namespace stepdriver::axis
