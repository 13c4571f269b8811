#include <algorithm>
#include <cstdio>
#include <limits>

#include "stepdriver_core/machine/capability.h"
#include "stepdriver_core/pulse/pulse_engine.h"

namespace stepdriver::machine {
namespace {

constexpr double kEndless = std::numeric_limits<double>::infinity();

/// What a step of an axis takes of the pulse thread's time, in nanoseconds.
struct Load {
  double rise;      // the calls for the rising edge: the read of an endstop and a write
  double calls;     // those for both edges
  double chip;      // high and low time
  double spinning;  // spinning before both edges, where nothing shortens it
  double alone;     // the shortest interval that doesn't spin too much, with no other axis moving
  double interval;  // of the steps at top speed
};

Load loadOf(const axis::AxisConfig& axis, const pulse::CallCost& cost,
            const pulse::WakeUps& wake_ups) {
  const auto write = static_cast<double>(cost.write.p99);
  const auto read = static_cast<double>(cost.read.p99);
  const auto high = static_cast<double>(axis.timing.step_high_ns);
  const auto guard = static_cast<double>(wake_ups.guard);
  Load load{};
  load.rise = read + write;
  load.calls = read + 2.0 * write;
  load.chip = high + static_cast<double>(axis.timing.step_low_ns);
  load.spinning = guard + std::min(guard, high);
  // A sleep ends late, and shortens the spinning; but there must be room for one.
  const double after_sleep =
      load.spinning - std::min(guard, static_cast<double>(wake_ups.slept.p50));
  if (guard > 0.0) {
    load.alone =
        std::max(guard + high + load.calls, after_sleep / pulse::SteadyClock::kMostSpinning);
  }
  load.interval = 1e9 / (axis.max_speed * axis.steps_per_unit);
  return load;
}

/// What the other axes take meanwhile, at their top speeds.
struct Others {
  double rise = 0.0;
  double calls = 0.0;
  double not_spinning = 1.0;  // share of the time

  void add(const Load& load) {
    rise += load.rise;
    calls += load.calls;
    not_spinning *= 1.0 - std::min(1.0, load.spinning / load.interval);
  }
};

/// The shortest interval that holds, and why none shorter does.
struct Interval {
  double ns;
  RateLimit limit;
  double lateness;
};

/// The shortest interval of an axis beside others with which the thread spins for no longer than it
/// may: the edges of the axes come at random to each other.
double shortestSpinning(const Load& load, const Others& others) {
  if (others.not_spinning == 1.0) return load.alone;
  const double room = 1.0 - (1.0 - pulse::SteadyClock::kMostSpinning) / others.not_spinning;
  return room > 0.0 ? std::max(load.alone, load.spinning / room) : kEndless;
}

/// @param spinning the shortest interval as far as spinning goes.
Interval shortest(const Load& load, const Others& others, pulse::Nanoseconds late,
                  double spinning) {
  const auto lateness = static_cast<double>(late);
  const double absorbed = 1.0 - pulse::PulseEngine::kClosest;
  const double pulse = 2.0 * lateness + load.calls + load.chip + others.calls;
  Interval interval{(lateness + load.rise + others.rise) / absorbed, RateLimit::kLateness,
                    lateness};
  if (pulse > interval.ns) interval = {pulse, RateLimit::kPulse, lateness};
  if (spinning > interval.ns) interval = {spinning, RateLimit::kSpinning, lateness};
  return interval;
}

Interval shortest(const Load& load, const Others& others, const pulse::WakeUps& wake_ups) {
  const Interval spun = shortest(load, others, wake_ups.spun.p99, shortestSpinning(load, others));
  const Interval slept = shortest(load, others, wake_ups.slept.p99, 0.0);
  return slept.ns < spun.ns ? slept : spun;
}

std::string inMicroseconds(double ns) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f us", ns * 1e-3);
  return text;
}

std::string percentText(double share) {
  return std::to_string(static_cast<int>(share * 100.0 + 0.5)) + " %";
}

std::string reasonOf(const Interval& interval, const Load& load, const Others& others,
                     pulse::Nanoseconds guard) {
  switch (interval.limit) {
    case RateLimit::kLateness:
      return "wake-ups late by " + inMicroseconds(interval.lateness) + " and calls of " +
             inMicroseconds(load.rise + others.rise) +
             " before the pulse is out must fit in a quarter of a step's interval";
    case RateLimit::kPulse:
      return "the chip's high and low time of " + inMicroseconds(load.chip) + ", calls of " +
             inMicroseconds(load.calls + others.calls) + " and two wake-ups late by " +
             inMicroseconds(interval.lateness) + " must fit in a step's interval";
    case RateLimit::kSpinning:
      break;
  }
  std::string text = "before an edge the pulse thread spins for " +
                     inMicroseconds(static_cast<double>(guard)) + ", which it may for " +
                     percentText(pulse::SteadyClock::kMostSpinning) + " of the time";
  if (others.not_spinning < 1.0) {
    text += "; the other axes take " + percentText(1.0 - others.not_spinning);
  }
  return text + ", and without spinning wake-ups are later";
}

std::string rateText(double rate) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0f", rate);
  return text;
}

}  // namespace

std::vector<StepRate> stepRates(const std::vector<axis::AxisConfig>& axes,
                                const Capability& capability) {
  const pulse::WakeUps& wake_ups = capability.wake_ups;
  std::vector<Load> loads;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    loads.push_back(loadOf(axes[i], capability.calls.at(i), wake_ups));
  }
  std::vector<StepRate> rates;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    Others others;
    for (std::size_t k = 0; k < loads.size(); ++k) {
      if (k != i) others.add(loads[k]);
    }
    const Interval interval = shortest(loads[i], others, wake_ups);
    StepRate rate;
    rate.axis = axes[i].name;
    rate.asked = 1e9 / loads[i].interval;
    rate.alone = 1e9 / shortest(loads[i], Others{}, wake_ups).ns;
    rate.held = 1e9 / interval.ns;
    rate.limit = interval.limit;
    rate.reason = reasonOf(interval, loads[i], others, wake_ups.guard);
    rates.push_back(rate);
  }
  return rates;
}

std::vector<std::string> shortfalls(const std::vector<StepRate>& rates) {
  std::vector<std::string> texts;
  for (const StepRate& rate : rates) {
    if (rate.enough()) continue;
    std::string text = "axis " + rate.axis + " asks for " + rateText(rate.asked) +
                       " steps/s at its top speed, and this machine holds " + rateText(rate.held);
    if (rates.size() > 1) {
      text += " while all axes move (" + rateText(rate.alone) + " alone)";
    }
    texts.push_back(text + ": " + rate.reason);
  }
  return texts;
}

std::string enforcementRefusal(const pulse::RealtimeRights& rights,
                               const std::vector<std::string>& shortfalls) {
  std::string reasons = rights.scheduler == 0 ? "" : "\n" + describe(rights);
  for (const std::string& shortfall : shortfalls) reasons += "\n" + shortfall;
  if (reasons.empty()) return "";
  return "realtime is enforced, and this machine isn't up to it:" + reasons + "\n" +
         remedyForRates() + ". With realtime: warn the axes start all the same";
}

std::string remedyForRates() {
  return "Lower the top speed or the microsteps, allow real-time rights, run a PREEMPT_RT kernel, "
         "or take the load off this machine; stepdriver_check measures again";
}

}  // namespace stepdriver::machine
