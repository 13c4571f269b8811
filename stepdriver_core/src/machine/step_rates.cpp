#include "stepdriver_core/machine/step_rates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "pulse/hybrid_wait.h"
#include "stepdriver_core/error.h"
#include "timeline/follower.h"

namespace stepdriver::machine {
namespace {

/// What limits the step rate of an axis.
enum class RateLimit { kLateness, kPulse, kSpinning };

constexpr double kEndless = std::numeric_limits<double>::infinity();
// [steps] What the engine absorbs in any case.
constexpr double kLeastAbsorbed = 1.0 - pulse::Follower::kClosest;
// The part of the time that pulses may take: the rest is for catching up.
constexpr double kMostPulses = 0.9;

/// The time of the pulse thread that a step of an axis takes, in nanoseconds.
struct Load {
  double absorbed;  // [steps] by which it may be late
  double rise;      // the calls for the rising edge: the read of an endstop and a write
  double calls;     // those for both edges
  double chip;      // high and low time
  double wake_ups;  // in a step: its end is one if the thread may sleep until then
  double spinning;  // spinning before both edges, if nothing shortens it
  double alone;     // the shortest interval that doesn't spin too much, with no other axis moving
  double interval;  // the interval of the steps at top speed

  /// [steps] How much lateness of so many nanoseconds is absorbed.
  double absorbedIn(double ns) const {
    return ns > pulse::Follower::kLongestCatchUp ? kLeastAbsorbed : absorbed;
  }
};

Load loadOf(const config::AxisConfig& axis, const pulse::CallCosts& cost,
            const pulse::Capability& capability) {
  const auto write = static_cast<double>(cost.write.p99);
  const auto read = static_cast<double>(cost.read.p99);
  // If each edge is a step, there is one write for each, and no time between the two of a pulse.
  const bool both = axis.stepsOnBothEdges();
  const auto high = both ? 0.0 : static_cast<double>(axis.timing().step_high_ns);
  const auto guard = static_cast<double>(capability.guard);
  Load load{};
  load.absorbed = std::max(kLeastAbsorbed, axis.microsteps * capability.late_steps);
  load.rise = read + write;
  load.calls = read + (both ? 1.0 : 2.0) * write;
  load.chip = static_cast<double>(axis.shortestStepNs());
  load.wake_ups = high > static_cast<double>(pulse::HybridWait::kShortWait) ? 2.0 : 1.0;
  load.spinning = guard + std::min(guard, high);
  // A sleep ends late, and shortens the spinning; but there must be room for one.
  const double after_sleep =
      load.spinning - std::min(guard, static_cast<double>(capability.sleep_lateness.median));
  if (guard > 0.0) {
    load.alone =
        std::max(guard + high + load.calls, after_sleep / pulse::HybridWait::kMostSpinning);
  }
  load.interval = 1e9 / (axis.max_speed * axis.steps_per_unit);
  return load;
}

/// The time that the other axes take meanwhile, at their top speeds.
struct Others {
  double rise = 0.0;
  double pulses = 0.0;        // calls, high and low times
  double not_spinning = 1.0;  // share of the time

  void add(const Load& load) {
    rise += load.rise;
    pulses += load.calls + load.chip;
    not_spinning *= 1.0 - std::min(1.0, load.spinning / load.interval);
  }
};

/// The shortest interval that can be sustained, and why a shorter one can't.
struct Interval {
  double ns;
  RateLimit limit;
  double lateness;
};

/// The shortest interval of an axis, together with the others, at which the thread stays within its
/// spinning limit: the edges of different axes are independent.
double shortestSpinning(const Load& load, const Others& others) {
  if (others.not_spinning == 1.0) return load.alone;
  const double room = 1.0 - (1.0 - pulse::HybridWait::kMostSpinning) / others.not_spinning;
  return room > 0.0 ? std::max(load.alone, load.spinning / room) : kEndless;
}

/// @param spinning the shortest interval with regard to spinning.
Interval shortest(const Load& load, const Others& others, pulse::Nanoseconds late,
                  double spinning) {
  const auto lateness = static_cast<double>(late);
  const double behind = load.wake_ups * lateness + load.rise + others.rise;
  const double pulse = (load.calls + load.chip + others.pulses) / kMostPulses;
  Interval interval{behind / load.absorbedIn(behind), RateLimit::kLateness, lateness};
  if (pulse > interval.ns) interval = {pulse, RateLimit::kPulse, lateness};
  if (spinning > interval.ns) interval = {spinning, RateLimit::kSpinning, lateness};
  return interval;
}

Interval shortest(const Load& load, const Others& others, const pulse::Capability& capability) {
  const Interval spun =
      shortest(load, others, capability.lateness.p99, shortestSpinning(load, others));
  const Interval slept = shortest(load, others, capability.sleep_lateness.p99, 0.0);
  return slept.ns < spun.ns ? slept : spun;
}

std::string inMicroseconds(double ns) { return fmt::format("{:.1f} us", ns * 1e-3); }

std::string percentText(double share) { return fmt::format("{} %", std::lround(share * 100.0)); }

std::string reasonOf(const Interval& interval, const Load& load, const Others& others,
                     pulse::Nanoseconds guard) {
  const double steps = load.absorbedIn(load.wake_ups * interval.lateness + load.rise + others.rise);
  switch (interval.limit) {
    case RateLimit::kLateness:
      return fmt::format(
          "wake-ups late by {} and calls of {} before the pulse is out must fit in the time of "
          "{:g} "
          "{}",
          inMicroseconds(interval.lateness), inMicroseconds(load.rise + others.rise), steps,
          steps == 1.0 ? "step" : "steps");
    case RateLimit::kPulse:
      return fmt::format(
          "the chips' high and low times and calls of {} for a step of each axis must fit in {} of "
          "a "
          "step's interval",
          inMicroseconds(load.chip + load.calls + others.pulses), percentText(kMostPulses));
    case RateLimit::kSpinning:
      break;
  }
  const std::string of_others =
      others.not_spinning < 1.0 ? "; the other axes take " + percentText(1.0 - others.not_spinning)
                                : "";
  return fmt::format(
      "before an edge the pulse thread spins for {}, which is allowed for {} of the time{}; "
      "without spinning, wake-ups are later",
      inMicroseconds(static_cast<double>(guard)), percentText(pulse::HybridWait::kMostSpinning),
      of_others);
}

// With the top speed of the motor that has the pins of an axis, for axes that share motors.
std::vector<config::AxisConfig> atMotorSpeeds(const std::vector<config::AxisConfig>& axes) {
  std::vector<config::AxisConfig> motors = axes;
  for (config::AxisConfig& motor : motors) {
    if (!motor.kinematics) continue;
    const std::size_t number = motor.kinematics->numberOf(motor.name);
    motor.max_speed = config::highestMotorSpeed(*motor.kinematics, number, axes);
    motor.kinematics.reset();
  }
  return motors;
}

constexpr double kRounding = 1e-9;  // the relative rounding of a rate

std::string rateText(double rate, double steps_per_round, double (*rounded)(double)) {
  std::string text = fmt::format("{:.0f} steps/s", rate);
  if (steps_per_round > 0.0) {
    text += fmt::format(" ({:.0f} rpm)", rounded(60.0 * rate / steps_per_round));
  }
  return text;
}

// Rounded away from each other: a rate that is too high doesn't look like one that can be
// sustained.
std::string neededText(double rate, double steps_per_round) {
  return rateText(std::ceil(rate * (1.0 - kRounding)), steps_per_round, std::ceil);
}
std::string sustainedText(double rate, double steps_per_round) {
  return rateText(std::floor(rate * (1.0 + kRounding)), steps_per_round, std::floor);
}

void requireAsMany(std::size_t axes, std::size_t others, const char* what) {
  if (axes == others) return;
  throw Error(fmt::format("{} {}, but there are {} axes", others, what, axes));
}

}  // namespace

std::string StepRate::text() const {
  const std::string of_alone = alone > held
                                   ? fmt::format(" while all axes move, and {} while only it does",
                                                 sustainedText(alone, steps_per_round))
                                   : "";
  return fmt::format("{} needs {}{} this computer can sustain {}{}: {}", axis,
                     neededText(asked, steps_per_round), holds() ? ", and" : ", but",
                     sustainedText(held, steps_per_round), of_alone, limited);
}

bool StepRates::holds() const {
  return std::all_of(axes.begin(), axes.end(), [](const StepRate& rate) { return rate.holds(); });
}

std::vector<std::string> StepRates::complaints() const {
  std::vector<std::string> complaints;
  for (const StepRate& rate : axes) {
    if (!rate.holds()) complaints.push_back(rate.text());
  }
  return complaints;
}

StepRates stepRates(const std::vector<config::AxisConfig>& configs,
                    const pulse::Capability& capability) {
  const std::vector<config::AxisConfig> axes = atMotorSpeeds(configs);
  requireAsMany(axes.size(), capability.channels.size(), "channels were measured");
  std::vector<Load> loads;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    loads.push_back(loadOf(axes[i], capability.channels[i], capability));
  }
  StepRates rates;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    Others others;
    for (std::size_t k = 0; k < loads.size(); ++k) {
      if (k != i) others.add(loads[k]);
    }
    const Interval interval = shortest(loads[i], others, capability);
    rates.axes.push_back({axes[i].name, 1e9 / loads[i].interval,
                          1e9 / shortest(loads[i], Others{}, capability).ns, 1e9 / interval.ns,
                          reasonOf(interval, loads[i], others, capability.guard),
                          axes[i].steps_per_round});
  }
  return rates;
}

StepRates stepRatesInMotion(const std::vector<config::AxisConfig>& axes,
                            const pulse::Capability& capability, const std::vector<double>& rates) {
  requireAsMany(axes.size(), capability.channels.size(), "channels were measured");
  requireAsMany(axes.size(), rates.size(), "rates are given");
  std::vector<config::AxisConfig> moving = axes;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    moving[i].max_speed = rates[i] / axes[i].steps_per_unit;
  }
  moving = atMotorSpeeds(moving);
  pulse::Capability of_moving = capability;
  of_moving.channels.clear();
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (moving[i].max_speed > 0.0) of_moving.channels.push_back(capability.channels[i]);
  }
  moving.erase(std::remove_if(moving.begin(), moving.end(),
                              [](const auto& axis) { return axis.max_speed <= 0.0; }),
               moving.end());
  return stepRates(moving, of_moving);
}

std::string whyNotInRealtime(const std::vector<config::AxisConfig>& axes,
                             const pulse::Capability& capability) {
  std::string why;
  if (!capability.rights.granted()) why = capability.rights.text();
  for (const std::string& complaint : stepRates(axes, capability).complaints()) {
    why += (why.empty() ? "" : "; ") + complaint;
  }
  if (why.empty()) return "";
  return fmt::format(
      "this computer doesn't meet the real-time requirements: {}. Lower the top speed or the "
      "microsteps, allow real-time scheduling, use a PREEMPT_RT kernel, or reduce this computer's "
      "load",
      why);
}

}  // namespace stepdriver::machine
