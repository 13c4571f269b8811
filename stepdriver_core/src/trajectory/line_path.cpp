#include "line_path.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include "math/root_finding.h"
#include "message_text.h"
#include "point_to_point/acceleration_ramp_down.h"
#include "point_to_point/planner.h"
#include "profile/composition.h"
#include "profile/errors.h"
#include "profile/position_range.h"
#include "profile/resting_count.h"

namespace stepdriver::motion {

namespace {

// [s] The search for a speed also tries motions that are longer than requested, but short enough to
// be planned.
constexpr double kLongestDuration = Profile::kLongest / 4.0;

}  // namespace

LinePath::LinePath(std::vector<PathAxis> axes, const std::vector<PathStart>& starts,
                   const std::vector<double>& targets, double velocity, double duration)
    : axes_(std::move(axes)) {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    origins_.push_back(starts[i].motor.position);
    // The backlash is taken up, so the motor moves the same distance as the joint.
    ways_.push_back(DoubleDouble(targets[i]) + starts[i].slack - origins_[i]);
    length_ = std::max(length_, static_cast<std::int64_t>(std::ceil(std::abs(ways_[i].value()))));
  }
  limits_ = tightest(&PathAxis::limits);
  stop_limits_ = tightest(&PathAxis::stop_limits);
  speed_ = velocity > 0.0 && length_ > 0 ? checkedSpeed(velocity) : limits_.max_speed;
  if (duration > 0.0 && length_ > 0) speed_ = speedFor(duration);
}

double LinePath::scale(std::size_t member) const {
  return std::abs(ways_[member].value()) / static_cast<double>(length_);
}

// Each axis moves in proportion to the path.
MotionLimits LinePath::tightest(MotionLimits PathAxis::*limits) const {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  MotionLimits path{kNone, kNone, kNone, kNone, kNone};
  const auto lower = [](double& limit, double other) { limit = std::min(limit, other); };
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    if (ways_[i].value() == 0.0) continue;
    const MotionLimits& own = axes_[i].*limits;
    const double share = scale(i);
    lower(path.start_speed, own.start_speed / share);
    lower(path.max_speed, own.max_speed / share);
    lower(path.acceleration, own.acceleration / share);
    lower(path.deceleration, own.deceleration / share);
    if (own.jerk > 0.0) lower(path.jerk, own.jerk / share);
  }
  if (path.jerk == kNone) path.jerk = 0.0;
  return path;
}

config::Kind LinePath::kindOfVelocity() const {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const bool moves = ways_[i].value() != 0.0;
    if (moves && axes_[i].kind == config::Kind::kLinear) return config::Kind::kLinear;
  }
  return config::Kind::kRotary;
}

double LinePath::pathSpeed(double velocity) const {
  const config::Kind kind = kindOfVelocity();
  double square = 0.0;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const double way = ways_[i].value() / axes_[i].steps_per_unit;
    if (axes_[i].kind == kind) square += way * way;
  }
  return velocity * static_cast<double>(length_) / std::sqrt(square);
}

double LinePath::checkedSpeed(double velocity) const {
  const double speed = pathSpeed(velocity);
  if (speed * (1.0 + 1e-9) < config::kLowestRate) {
    axes_.front().refuse(fmt::format(
        "the velocity {0} {2} of the line is below the lowest in its direction, {1} {2}, at which "
        "the axis with the most steps makes {3} steps/s",
        numberText(velocity), lowerBoundText(velocity / speed * config::kLowestRate),
        kindOfVelocity() == config::Kind::kLinear ? "m/s" : "rad/s",
        numberText(config::kLowestRate)));
  }
  if (speed <= limits_.max_speed * (1.0 + 1e-12)) return std::min(speed, limits_.max_speed);
  axes_.front().refuse(fmt::format(
      "the velocity {0} {2} of the line is above the {1} {2} that the limits of its axes "
      "allow in its direction",
      numberText(velocity), upperBoundText(velocity * limits_.max_speed / speed),
      kindOfVelocity() == config::Kind::kLinear ? "m/s" : "rad/s"));
}

double LinePath::durationAt(double speed) const {
  MotionLimits limits = limits_;
  limits.max_speed = speed;
  try {
    return planMove(0, {}, length_, limits).profile.duration().value();
  } catch (const TooLong& error) {
    axes_.front().refuse(error.what());
  }
}

double LinePath::shortestDuration() const {
  return length_ == 0 ? 0.0 : durationAt(limits_.max_speed);
}

double LinePath::speedFor(double duration) const {
  if (!(duration <= kLongestDuration)) {
    axes_.front().refuse(fmt::format("the duration of the line is {} s, but must be at most {} s",
                                     numberText(duration), numberText(kLongestDuration)));
  }
  const double highest = limits_.max_speed;
  const double fastest = durationAt(highest);
  if (duration < fastest * (1.0 - 1e-9)) {
    axes_.front().refuse(
        fmt::format("the target can't be reached in {} s; the limits of the axes allow {} s",
                    numberText(duration), lowerBoundText(fastest)));
  }
  if (duration <= fastest) return highest;
  // The duration falls as the speed rises.
  double low = static_cast<double>(length_) / (2.0 * duration);
  while (low > 0.0 && durationAt(low) < duration) low /= 2.0;
  const auto too_long = [&](DoubleDouble more) {
    return DoubleDouble(durationAt(low + more.value()) - duration);
  };
  return std::min(highest, low + rootOf(too_long, highest - low).value());
}

bool LinePath::isOf(const std::vector<PathAxis>& axes, const std::vector<PathStart>& starts) const {
  return axes_ == axes && std::equal(starts.begin(), starts.end(), origins_.begin(),
                                     [](const PathStart& start, const DoubleDouble& origin) {
                                       return (start.motor.position - origin).value() == 0.0;
                                     });
}

void LinePath::requireStart(const std::vector<PathStart>& starts) const {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const PathStart& start = starts[i];
    if (start.moves || (start.motor.position - origins_[i]).value() != 0.0) {
      axes_[i].refuse("busy: another motion began before the line");
    }
  }
}

Profile LinePath::plan(std::int64_t at, const MotionState& from, double speed_override) const {
  MotionLimits limits = limits_;
  limits.max_speed = std::min(speed_ * speed_override, limits_.max_speed);
  // The jerk of a hold may be higher.
  const AccelerationRampDown ramp_down(at, from, limits_, stop_limits_.jerk);
  Plan plan = ramp_down.followedBy(planMove(ramp_down.endNs(), ramp_down.end(), length_, limits));
  if (plan.overshoot <= kNoStep) return plan.profile;
  // A stop may also speed up, to rest on a whole step, or leave too little room for a lower jerk. A
  // motion that such a stop has begun can end within the limits of stops.
  MotionLimits as_stop = stop_limits_;
  as_stop.max_speed = limits.max_speed;
  Plan kept = planMove(at, from, length_, as_stop);
  return kept.overshoot < plan.overshoot ? kept.profile : plan.profile;
}

Profile LinePath::planStop(std::int64_t at, const MotionState& from) const {
  return motion::planStop(at, from, stop_limits_, length_);
}

Profile LinePath::profileOf(std::size_t member, const Profile& path) const {
  const DoubleDouble share = length_ == 0 ? DoubleDouble() : ways_[member] / fromInteger(length_);
  return scaled(path, origins_[member], share);
}

}  // namespace stepdriver::motion
