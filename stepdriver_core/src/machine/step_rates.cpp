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
  double rise;    // the calls for the rising edge: the read of an endstop and a write
  double calls;   // those for both edges
  double chip;    // high and low time
  double spun;    // spinning before both edges
  double per_ns;  // steps at top speed
};

Load loadOf(const axis::AxisConfig& axis, const pulse::CallCost& cost, pulse::Nanoseconds guard) {
  const auto write = static_cast<double>(cost.write.p99);
  const auto read = static_cast<double>(cost.read.p99);
  Load load{};
  load.rise = read + write;
  load.calls = read + 2.0 * write;
  load.chip = static_cast<double>(axis.timing.step_high_ns + axis.timing.step_low_ns);
  load.spun = static_cast<double>(guard + std::min(guard, axis.timing.step_high_ns));
  load.per_ns = axis.max_speed * axis.steps_per_unit * 1e-9;
  return load;
}

/// What the other axes take meanwhile.
struct Others {
  double rise = 0.0;
  double calls = 0.0;
  double spinning = 0.0;  // share of the time
};

/// The shortest interval that holds, and why none shorter does.
struct Interval {
  double ns;
  RateLimit limit;
  double lateness;
};

/// @param spinning the interval that spinning alone allows.
Interval shortest(const Load& load, const Others& others, double lateness, double spinning) {
  const double late = (lateness + load.rise + others.rise) / (1.0 - pulse::PulseEngine::kClosest);
  const double pulse = 2.0 * lateness + load.calls + load.chip + others.calls;
  Interval interval{late, RateLimit::kLateness, lateness};
  if (pulse > interval.ns) interval = {pulse, RateLimit::kPulse, lateness};
  if (spinning > interval.ns) interval = {spinning, RateLimit::kSpinning, lateness};
  return interval;
}

Interval shortest(const Load& load, const Others& others, const pulse::WakeUps& wake_ups) {
  const double room = pulse::SteadyClock::kMostSpinning - others.spinning;
  const Interval spun = shortest(load, others, static_cast<double>(wake_ups.spun.p99),
                                 room > 0.0 ? load.spun / room : kEndless);
  const Interval slept = shortest(load, others, static_cast<double>(wake_ups.slept.p99), 0.0);
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
  std::string text = "the pulse thread spins for " + inMicroseconds(static_cast<double>(guard)) +
                     " before an edge, and may for " +
                     percentText(pulse::SteadyClock::kMostSpinning) + " of the time only";
  if (others.spinning > 0.0) {
    text += ", of which the other axes take " + percentText(others.spinning);
  }
  return text;
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
    loads.push_back(loadOf(axes[i], capability.calls.at(i), wake_ups.guard));
  }
  std::vector<StepRate> rates;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    Others others;
    for (std::size_t k = 0; k < loads.size(); ++k) {
      if (k == i) continue;
      others.rise += loads[k].rise;
      others.calls += loads[k].calls;
      others.spinning += loads[k].spun * loads[k].per_ns;
    }
    const Interval interval = shortest(loads[i], others, wake_ups);
    StepRate rate;
    rate.axis = axes[i].name;
    rate.asked = loads[i].per_ns * 1e9;
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
