#include "rates_report.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>

#include "common/text.h"
#include "table.h"

namespace stepdriver::check {
namespace {

using ros_node::roundedText;
using ros_node::rpmText;

std::string inMicroseconds(pulse::Nanoseconds time) {
  return fmt::format("{:.2f}", static_cast<double>(time) * 1e-3);
}

std::vector<std::string> rowOf(const std::string& what, const pulse::Spread& spread) {
  return {what,
          inMicroseconds(spread.median),
          inMicroseconds(spread.p90),
          inMicroseconds(spread.p99),
          inMicroseconds(spread.max),
          std::to_string(spread.count)};
}

/// Rounded down: a user who enters this value must not be told that it is too high.
std::string rateText(double rate) { return roundedText(std::floor(rate)); }

}  // namespace

std::string measurementsText(const std::vector<config::AxisConfig>& axes,
                             const pulse::Capability& capability) {
  std::vector<std::vector<std::string>> rows = {{"[us]", "median", "p90", "p99", "max", "samples"}};
  for (std::size_t i = 0; i < capability.channels.size(); ++i) {
    rows.push_back(rowOf("write of " + axes[i].name + "/step", capability.channels[i].write));
    const pulse::Spread& read = capability.channels[i].read;
    if (read.count > 0) rows.push_back(rowOf("read of an endstop of " + axes[i].name, read));
  }
  rows.push_back(rowOf("lateness of a wake-up, with spinning", capability.lateness));
  rows.push_back(rowOf("lateness of a wake-up, without", capability.sleep_lateness));
  return table(rows);
}

std::string ratesText(const machine::StepRates& rates) {
  std::vector<std::vector<std::string>> rows = {
      {"[steps/s]", "needs", "rpm", "sustained alone", "rpm", "sustained with all", "rpm"}};
  std::string reasons;
  for (const machine::StepRate& rate : rates.axes) {
    const double per_round = rate.steps_per_round;
    rows.push_back({rate.axis, roundedText(rate.asked), rpmText(rate.asked, per_round),
                    rateText(rate.alone), rpmText(rate.alone, per_round), rateText(rate.held),
                    rpmText(rate.held, per_round), rate.holds() ? "ok" : "TOO FAST"});
    reasons += fmt::format("  {}: {}\n", rate.axis, rate.limited);
  }
  return table(rows) + "  What limits the rate with all axes moving:\n" + reasons;
}

std::string tooFast(const machine::StepRates& rates) {
  std::string names;
  for (const machine::StepRate& rate : rates.axes) {
    if (!rate.holds()) names += (names.empty() ? "" : ", ") + rate.axis;
  }
  return names;
}

}  // namespace stepdriver::check
