#include "line_course.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include "message_text.h"
#include "stepdriver_core/motion/along.h"

namespace stepdriver::axis {
namespace {

constexpr int kHalvings = 200;

}  // namespace

LineCourse::LineCourse(std::vector<Axis::Impl*> own_axes, const std::vector<std::int64_t>& targets,
                       double velocity)
    : Course(std::move(own_axes)) {
  for (std::size_t i = 0; i < axes().size(); ++i) {
    Axis::Impl& axis = *axes()[i];
    origins_.push_back(axis.stateAt(0).position);
    // The backlash is taken up, so that the motor makes the way of the joint.
    const std::int64_t slack = axis.harvest().slack;
    ways_.push_back(motion::fromInteger(targets[i] + slack) - origins_[i]);
    length_ = std::max(length_, static_cast<std::int64_t>(std::ceil(std::abs(ways_[i].value()))));
  }
  takeLimits();
  speed_ = velocity > 0.0 ? std::min(limits_.max_speed, pathSpeed(velocity)) : limits_.max_speed;
}

double LineCourse::scale(std::size_t member) const {
  return std::abs(ways_[member].value()) / static_cast<double>(length_);
}

// Each axis does its scale of what the path does.
void LineCourse::takeLimits() {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  limits_ = {kNone, kNone, kNone, kNone, 0.0};
  stop_deceleration_ = kNone;
  double jerk = kNone;
  const auto lower = [](double& limit, double other) { limit = std::min(limit, other); };
  for (std::size_t i = 0; i < axes().size(); ++i) {
    if (ways_[i].value() == 0.0) continue;
    const Axis::Impl& axis = *axes()[i];
    const motion::MotionLimits own = axis.limits(axis.maxSpeed());
    const double share = scale(i);
    lower(limits_.start_speed, own.start_speed / share);
    lower(limits_.max_speed, own.max_speed / share);
    lower(limits_.acceleration, own.acceleration / share);
    lower(limits_.deceleration, own.deceleration / share);
    lower(stop_deceleration_, axis.stopDeceleration() / share);
    if (own.jerk > 0.0) lower(jerk, own.jerk / share);
  }
  if (jerk < kNone) limits_.jerk = jerk;
}

// Of the linear axes where one of them moves, else of the rotary ones.
double LineCourse::pathSpeed(double velocity) const {
  double linear = 0.0;
  double rotary = 0.0;
  for (std::size_t i = 0; i < axes().size(); ++i) {
    const Axis::Impl& axis = *axes()[i];
    const double way = ways_[i].value() / axis.stepsPerUnit();
    (axis.config.kind == Kind::kLinear ? linear : rotary) += way * way;
  }
  return velocity * static_cast<double>(length_) / std::sqrt(linear > 0.0 ? linear : rotary);
}

double LineCourse::durationAt(double speed) const {
  motion::MotionLimits limits = limits_;
  limits.max_speed = speed;
  return motion::planMove(0, {}, length_, limits).profile.duration().value();
}

void LineCourse::stretchTo(double duration) {
  if (length_ == 0) return;
  const double fastest = durationAt(limits_.max_speed);
  if (duration < fastest * (1.0 - 1e-9)) {
    axes().front()->refuse("the line can't be done in " + numberText(duration) +
                           " s; the axes' limits allow " + lowerBoundText(fastest) + " s");
  }
  // The duration falls as the speed rises.
  double low = static_cast<double>(length_) / (2.0 * duration);
  double high = limits_.max_speed;
  while (low > 0.0 && durationAt(low) < duration) low /= 2.0;
  for (int i = 0; i < kHalvings && low < high; ++i) {
    const double middle = low + (high - low) / 2.0;
    if (middle == low || middle == high) break;
    (durationAt(middle) < duration ? high : low) = middle;
  }
  speed_ = high;
}

void LineCourse::start(std::int64_t at) {
  for (std::size_t i = 0; i < axes().size(); ++i) {
    Axis::Impl& axis = *axes()[i];
    if (axis.moving() || (axis.stateAt(at).position - origins_[i]).value() != 0.0) {
      axis.refuse("busy: another motion began before the line");
    }
  }
}

motion::MotionState LineCourse::begin() const { return {}; }

motion::Profile LineCourse::plan(std::int64_t at, const motion::MotionState& from,
                                 double speed_override) const {
  motion::MotionLimits limits = limits_;
  limits.max_speed = std::min(speed_ * speed_override, limits_.max_speed);
  return motion::planMove(at, from, length_, limits).profile;
}

motion::Profile LineCourse::planStop(std::int64_t at, const motion::MotionState& from) const {
  motion::MotionLimits limits = limits_;
  limits.deceleration = stop_deceleration_;
  return motion::planStop(at, from, limits, length_);
}

motion::Profile LineCourse::profileOf(std::size_t member, const motion::Profile& path) const {
  const motion::DoubleDouble scale =
      length_ == 0 ? motion::DoubleDouble() : ways_[member] / motion::fromInteger(length_);
  return motion::scaled(path, origins_[member], scale);
}

}  // namespace stepdriver::axis
