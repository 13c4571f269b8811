#include "stepdriver_core/machine/step_rates.h"

#include <algorithm>
#include <cstdio>

namespace stepdriver::machine {
namespace {

template <typename... Values>
std::string format(const char* form, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, form, values...);
  return text;
}

double microseconds(pulse::Nanoseconds time) { return static_cast<double>(time) * 1e-3; }

StepRate rateOf(const axis::AxisConfig& axis, const pulse::CallCosts& costs,
                pulse::Nanoseconds late) {
  const pulse::Nanoseconds high = axis.timing.step_high_ns;
  const pulse::Nanoseconds low = axis.timing.step_low_ns;
  const pulse::Nanoseconds busy = costs.read.median + 2 * costs.write.median + high + low + late;
  const auto absorbed = static_cast<pulse::Nanoseconds>(static_cast<double>(late) /
                                                        (1.0 - pulse::PulseEngine::kClosest));
  StepRate rate;
  rate.axis = axis.name;
  rate.asked = axis.max_speed * axis.steps_per_unit;
  rate.held = 1e9 / static_cast<double>(std::max(busy, absorbed));
  if (absorbed > busy) {
    rate.limited = format(
        "wake-ups are up to %.1f us late (p99), and a quarter of an interval can "
        "be made good",
        microseconds(late));
  } else {
    rate.limited = format(
        "a step takes two writes of %.1f us, %.1f us for the endstop, %.1f us "
        "high and %.1f us low, and %.1f us for late wake-ups (p99)",
        microseconds(costs.write.median), microseconds(costs.read.median), microseconds(high),
        microseconds(low), microseconds(late));
  }
  return rate;
}

}  // namespace

std::string StepRate::text() const {
  return axis + ": asks for " +
         format("%.0f steps/s, and this machine holds %.0f steps/s: ", asked, held) + limited;
}

bool StepRates::holds() const {
  return load <= kHighestLoad &&
         std::all_of(axes.begin(), axes.end(), [](const StepRate& rate) { return rate.holds(); });
}

std::vector<std::string> StepRates::complaints() const {
  std::vector<std::string> complaints;
  for (const StepRate& rate : axes) {
    if (!rate.holds()) complaints.push_back(rate.text());
  }
  if (load > kHighestLoad) {
    complaints.push_back(
        format("with all axes at their top speeds the calls to their lines take "
               "%.0f %% of the time, and more than %.0f %% can't be had",
               load * 100.0, kHighestLoad * 100.0));
  }
  return complaints;
}

StepRates stepRates(const std::vector<axis::AxisConfig>& axes,
                    const pulse::Capability& capability) {
  StepRates rates;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const pulse::CallCosts& costs = capability.channels.at(i);
    rates.axes.push_back(rateOf(axes[i], costs, capability.lateness.p99));
    const auto calls = static_cast<double>(costs.read.median + 2 * costs.write.median);
    rates.load += rates.axes.back().asked * calls * 1e-9;
  }
  return rates;
}

}  // namespace stepdriver::machine
