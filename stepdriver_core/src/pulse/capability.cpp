#include "stepdriver_core/pulse/capability.h"

#include <pthread.h>

#include <algorithm>
#include <functional>
#include <thread>
#include <utility>

namespace stepdriver::pulse {
namespace {

// Deadlines as far apart as the steps of a slow motion: a processor that slept for as long needs
// its time to wake.
constexpr Nanoseconds kPeriod = 1'000'000;
constexpr std::size_t kSpunWaits = 250;
constexpr std::size_t kSleptWaits = 150;
// On a machine that stalls there are fewer of them.
constexpr Nanoseconds kLongestWaits = 1'000'000'000;

constexpr std::size_t kCalls = 200;
// A chip behind I2C takes its time.
constexpr Nanoseconds kLongestCalls = 20'000'000;

/// Does it in a thread like the pulse thread. @return what that thread was granted.
RealtimeRights asPulseThread(const std::function<void()>& action) {
  RealtimeRights rights;
  rights.memory = lockMemory();
  std::thread thread([&] {
    pthread_setname_np(pthread_self(), "measure");
    rights.scheduler = requestScheduling();
    action();
  });
  thread.join();
  return rights;
}

/// @param take one sample; false: it failed, and none follows.
std::vector<Nanoseconds> sample(Clock& clock, std::size_t count, Nanoseconds longest,
                                const std::function<bool(Nanoseconds&)>& take) {
  std::vector<Nanoseconds> times;
  times.reserve(count);
  const Nanoseconds end = clock.now() + longest;
  while (times.size() < count && (times.empty() || clock.now() < end)) {
    Nanoseconds time = 0;
    if (!take(time)) break;
    times.push_back(time);
  }
  return times;
}

/// The first call is thrown away: it brings the code into the cache.
Spread costOf(Clock& clock, const std::function<int()>& call, int& error) {
  const auto take = [&](Nanoseconds& time) {
    const Nanoseconds begin = clock.now();
    const int result = call();
    time = clock.now() - begin;
    if (result != 0) error = result;
    return result == 0;
  };
  Nanoseconds first = 0;
  if (!take(first)) return {};
  return spreadOf(sample(clock, kCalls, kLongestCalls, take));
}

CallCost costOf(gpio::Lines& lines, Clock& clock, const ChannelConfig& channel) {
  CallCost cost;
  const gpio::LineWrite at_rest{channel.step.line, !channel.step.active};
  cost.write = costOf(
      clock, [&] { return lines.write(&at_rest, 1); }, cost.error);
  for (const auto& endstop : {channel.endstop_min, channel.endstop_max}) {
    if (!endstop || cost.error != 0) continue;
    const auto read = [&] {
      const int level = lines.read(endstop->line);
      return level < 0 ? -level : 0;
    };
    const Spread spread = costOf(clock, read, cost.error);
    if (spread.p99 >= cost.read.p99) cost.read = spread;
  }
  return cost;
}

}  // namespace

Spread spreadOf(std::vector<Nanoseconds> times) {
  Spread spread;
  if (times.empty()) return spread;
  std::sort(times.begin(), times.end());
  const auto percentile = [&](std::size_t percent) {
    return times[(times.size() * percent + 99) / 100 - 1];
  };
  spread.count = times.size();
  spread.p50 = percentile(50);
  spread.p90 = percentile(90);
  spread.p99 = percentile(99);
  spread.max = times.back();
  return spread;
}

WakeUps measureWakeUps(Clock& clock) {
  WakeUps wake_ups;
  wake_ups.guard = clock.guard();
  using Wait = void (Clock::*)(Nanoseconds);
  const auto latenessOf = [&clock](Wait wait, std::size_t count) {
    return spreadOf(sample(clock, count, kLongestWaits, [&](Nanoseconds& late) {
      const Nanoseconds deadline = clock.now() + kPeriod;
      while (clock.now() < deadline) (clock.*wait)(deadline);
      late = clock.now() - deadline;
      return true;
    }));
  };
  wake_ups.rights = asPulseThread([&] {
    wake_ups.spun = latenessOf(&Clock::waitUntil, kSpunWaits);
    wake_ups.slept = latenessOf(&Clock::sleepUntil, kSleptWaits);
  });
  return wake_ups;
}

std::vector<CallCost> measureCalls(gpio::Lines& lines, Clock& clock,
                                   const std::vector<ChannelConfig>& channels) {
  std::vector<CallCost> costs;
  costs.reserve(channels.size());
  asPulseThread([&] {
    for (const ChannelConfig& channel : channels) costs.push_back(costOf(lines, clock, channel));
  });
  return costs;
}

}  // namespace stepdriver::pulse
