#include "stepdriver_core/pulse/capability.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <thread>

#include "stepdriver_core/error.h"

namespace stepdriver::pulse {
namespace {

constexpr Nanoseconds kBetweenWakeUps = 1'000'000;

template <typename Call>
Spread costOf(Clock& clock, int& error, const Call& call) {
  std::vector<Nanoseconds> samples;
  samples.reserve(kMeasuredCalls);
  while (samples.size() < kMeasuredCalls && error == 0) {
    const Nanoseconds begin = clock.now();
    error = call();
    samples.push_back(clock.now() - begin);
  }
  return spreadOf(std::move(samples));
}

Spread latenessOf(Clock& clock) {
  std::vector<Nanoseconds> samples;
  samples.reserve(kMeasuredWakeUps);
  while (samples.size() < kMeasuredWakeUps) {
    const Nanoseconds due = clock.now() + kBetweenWakeUps;
    while (clock.now() < due) clock.waitUntil(due);
    samples.push_back(clock.now() - due);
  }
  return spreadOf(std::move(samples));
}

CallCosts callCosts(gpio::Lines& lines, Clock& clock, const ChannelConfig& channel, int& error) {
  CallCosts costs;
  const gpio::LineWrite at_rest{channel.step.line, !channel.step.active};
  costs.write = costOf(clock, error, [&] { return lines.write(&at_rest, 1); });
  const auto& endstop = channel.endstop_max ? channel.endstop_max : channel.endstop_min;
  if (endstop && error == 0) {
    costs.read = costOf(clock, error, [&] { return std::max(0, -lines.read(endstop->line)); });
  }
  return costs;
}

}  // namespace

Spread spreadOf(std::vector<Nanoseconds> samples) {
  std::sort(samples.begin(), samples.end());
  const auto at = [&samples](double part) {
    const auto last = static_cast<double>(samples.size() - 1);
    return samples[static_cast<std::size_t>(part * last + 0.5)];
  };
  return {at(0.5), at(0.9), at(0.99), samples.back()};
}

Capability measureCapability(gpio::Lines& lines, Clock& clock,
                             const std::vector<ChannelConfig>& channels) {
  Capability capability;
  capability.rights.memory_error = lockMemory();
  int error = 0;
  std::thread([&] {
    capability.rights.scheduler_error = askForScheduler();
    for (const ChannelConfig& channel : channels) {
      if (error == 0) capability.channels.push_back(callCosts(lines, clock, channel, error));
    }
    if (error == 0) capability.lateness = latenessOf(clock);
  }).join();
  if (error != 0) {
    throw GpioError("a line failed while its cost was measured: " +
                    std::string(std::strerror(error)));
  }
  return capability;
}

}  // namespace stepdriver::pulse
