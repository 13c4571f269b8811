#include "stepdriver_core/pulse/capability.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "channel/channel_config.h"
#include "gpio/chip_table.h"
#include "pulse/cpu_latency.h"
#include "pulse/measure.h"
#include "pulse/realtime.h"
#include "start_thread.h"
#include "stepdriver_core/error.h"

namespace stepdriver::pulse {
namespace {

constexpr Nanoseconds kBetweenWakeUps = 1'000'000;
constexpr Nanoseconds kLongestWaits = 1'000'000'000;
// A chip behind I2C is slow.
constexpr Nanoseconds kLongestCalls = 20'000'000;

/// Takes samples for no longer than that, but at least one.
template <typename Sample>
Spread spreadOfMany(Clock& clock, int count, Nanoseconds longest, const Sample& sample) {
  std::vector<Nanoseconds> samples;
  samples.reserve(static_cast<std::size_t>(count));
  const Nanoseconds end = clock.now() + longest;
  do {
    samples.push_back(sample());
  } while (samples.size() < static_cast<std::size_t>(count) && clock.now() < end);
  return spreadOf(std::move(samples));
}

using Wait = void (Clock::*)(Nanoseconds);

Spread latenessOf(Clock& clock, Wait wait, int count) {
  return spreadOfMany(clock, count, kLongestWaits, [&] {
    const Nanoseconds due = clock.now() + kBetweenWakeUps;
    while (clock.now() < due) (clock.*wait)(due);
    return clock.now() - due;
  });
}

/// Measures the calls of one channel after the other, until one fails.
class CallMeter {
 public:
  CallMeter(gpio::Lines& lines, Clock& clock) : lines_(lines), clock_(clock) {}

  CallCosts measure(const ChannelConfig& channel) {
    CallCosts costs;
    const Signal& step = channel.patterns.empty() ? channel.step : channel.coils.front();
    const gpio::LineWrite at_rest{step.line, !step.active};
    costs.write = costOf(lines_.outputName(step.line), [&] { return lines_.write(&at_rest, 1); });
    for (const auto& endstop : {channel.endstop_min, channel.endstop_max}) {
      if (!endstop) continue;
      const Spread read = costOf(lines_.inputName(endstop->line),
                                 [&] { return std::max(0, -lines_.read(endstop->line)); });
      if (read.p99 >= costs.read.p99) costs.read = read;
    }
    return costs;
  }

  /// The call that failed, in words; empty: no failure.
  const std::string& failure() const { return failure_; }

 private:
  template <typename Call>
  Spread costOf(const std::string& line, const Call& call) {
    const auto timed = [&] {
      const Nanoseconds begin = clock_.now();
      const int error = failure_.empty() ? call() : 0;
      if (error != 0) {
        failure_ = fmt::format("Line {} failed while the cost of its calls was measured: {}.", line,
                               gpio::errorText(error));
      }
      return clock_.now() - begin;
    };
    timed();  // loads the code into the caches
    return spreadOfMany(clock_, kMeasuredCalls, kLongestCalls, timed);
  }

  gpio::Lines& lines_;
  Clock& clock_;
  std::string failure_;
};

/// @param measure_calls false: one failed, and nothing else is measured.
Capability asPulseThread(Clock& clock, const RealtimeRequest& request,
                         const std::function<bool(Capability&)>& measure_calls) {
  Capability capability;
  capability.rights.memory_error = lockMemory();
  std::optional<CpuLatencyHold> awake;
  if (!request.latency_device.empty()) {
    awake.emplace(request.latency_device);
    capability.rights.latency_error = awake->error();
  }
  startThread([&] {
    capability.rights.scheduler_error = askForScheduler(kRealtimePriority);
    if (request.cpu) {
      capability.rights.cpu = *request.cpu;
      capability.rights.cpu_error = stayOnProcessor(*request.cpu);
    }
    if (!measure_calls(capability)) return;
    capability.lateness = latenessOf(clock, &Clock::waitUntil, kMeasuredWakeUps);
    capability.sleep_lateness = latenessOf(clock, &Clock::sleepUntil, kMeasuredSleeps);
  }).join();
  capability.guard = clock.guard();  // after the wake-ups from which it learns
  return capability;
}

}  // namespace

Spread spreadOf(std::vector<Nanoseconds> samples) {
  std::sort(samples.begin(), samples.end());
  const auto at = [&samples](double part) {
    const auto last = static_cast<double>(samples.size() - 1);
    return samples[static_cast<std::size_t>(std::lround(part * last))];
  };
  return {at(0.5), at(0.9), at(0.99), samples.back(), samples.size()};
}

Capability measureCapability(gpio::Lines& lines, Clock& clock,
                             const std::vector<ChannelConfig>& channels,
                             const RealtimeRequest& request) {
  CallMeter meter(lines, clock);
  Capability capability = asPulseThread(clock, request, [&](Capability& measured) {
    for (const ChannelConfig& channel : channels) {
      measured.channels.push_back(meter.measure(channel));
    }
    return meter.failure().empty();
  });
  if (!meter.failure().empty()) throw GpioError(meter.failure());
  return capability;
}

Capability measureWakeUps(Clock& clock, const RealtimeRequest& request) {
  return asPulseThread(clock, request, [](Capability& /*measured*/) { return true; });
}

}  // namespace stepdriver::pulse
