#include "engine_diagnostics.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "common/text.h"

namespace stepdriver::ros_node {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using diagnostic_updater::DiagnosticStatusWrapper;

std::string microseconds(pulse::Nanoseconds time) {
  return roundedText(static_cast<double>(time) * 1e-3);
}

void judgeLateness(const EngineReading& reading, DiagnosticStatusWrapper& status) {
  const double late = static_cast<double>(reading.figures.lateness_last_second.max) * 1e-9;
  if (late < reading.max_lateness * kLatenessPart) return;
  const bool too_late = late > reading.max_lateness;
  status.mergeSummary(
      too_late ? DiagnosticStatus::ERROR : DiagnosticStatus::WARN,
      fmt::format("in the last second a pulse was {} ms late; beyond realtime/max_lateness_ms, {} "
                  "ms, it is a fault at speed",
                  roundedText(late * 1e3), roundedText(reading.max_lateness * 1e3)));
}

void judgeSlips(const EngineReading& reading, DiagnosticStatusWrapper& status) {
  const std::uint64_t slips = reading.figures.slips - reading.slips_before;
  if (slips == 0) return;
  status.mergeSummary(
      DiagnosticStatus::WARN,
      fmt::format("late pulses made all motions take longer, {} {} in the last second", slips,
                  slips == 1 ? "time" : "times"));
}

void judgeMargins(const EngineReading& reading, DiagnosticStatusWrapper& status) {
  for (const machine::StepRate& rate : reading.rates_in_motion) {
    if (!rate.holds()) {
      status.mergeSummary(DiagnosticStatus::ERROR, "too fast a motion: " + rate.text());
    } else if (rate.held < rate.asked * kLeastMargin) {
      status.mergeSummary(DiagnosticStatus::WARN, "little margin: " + rate.text());
    }
  }
  for (const machine::StepRate& rate : reading.rates) {
    if (!rate.holds()) status.mergeSummary(DiagnosticStatus::WARN, "at top speed " + rate.text());
  }
}

/// The first rate of an axis; nullptr: there is none.
const machine::StepRate* find(const std::vector<machine::StepRate>& rates,
                              const std::string& axis) {
  const auto found =
      std::find_if(rates.begin(), rates.end(), [&](const auto& rate) { return rate.axis == axis; });
  return found != rates.end() ? &*found : nullptr;
}

void addMargins(const EngineReading& reading, DiagnosticStatusWrapper& status) {
  for (const machine::StepRate& rate : reading.rates) {
    const machine::StepRate* const now = find(reading.rates_in_motion, rate.axis);
    const auto add_rate = [&](const std::string& of, double steps) {
      status.add(rate.axis + ": steps/s" + of, roundedText(steps));
      status.add(rate.axis + ": rpm" + of, rpmText(steps, rate.steps_per_round));
    };
    add_rate("", now != nullptr ? now->asked : 0.0);
    status.add(rate.axis + ": margin",
               now != nullptr ? roundedText(now->held / now->asked) : "at rest");
    add_rate(" at top speed", rate.asked);
    add_rate(" that this computer sustains", rate.held);
    status.add(rate.axis + ": margin at top speed", roundedText(rate.held / rate.asked));
  }
  if (reading.rates.empty()) status.add("margin", "not measured: the lines are simulated");
}

void addLateness(const std::string& when, const pulse::LatenessFigures& figures,
                 DiagnosticStatusWrapper& status) {
  status.add("pulses " + when, figures.count);
  status.add("lateness " + when + " p50 [us]", microseconds(figures.p50));
  status.add("lateness " + when + " p99 [us]", microseconds(figures.p99));
  status.add("lateness " + when + " p99.9 [us]", microseconds(figures.p999));
  status.add("lateness " + when + " max [us]", microseconds(figures.max));
}

}  // namespace

void reportEngine(const EngineReading& reading, DiagnosticStatusWrapper& status) {
  const machine::EngineFigures& figures = reading.figures;
  status.summary(DiagnosticStatus::OK, "pulses in time");
  judgeLateness(reading, status);
  judgeSlips(reading, status);
  judgeMargins(reading, status);
  status.add("edges", figures.edges);
  status.add("slips", figures.slips);
  status.add("slipped [s]", figures.slipped);
  addLateness("since the start", figures.lateness, status);
  addLateness("in the last second", figures.lateness_last_second, status);
  status.add("pulse thread", figures.realtime);
  addMargins(reading, status);
}

}  // namespace stepdriver::ros_node
