#include "port/klipper/step_compressor.h"

#include <algorithm>
#include <cstdlib>
#include <limits>

namespace stepdriver::klipper {
namespace {

constexpr std::int64_t kMostInterval = std::numeric_limits<std::uint32_t>::max();
constexpr std::int64_t kLeastAdd = std::numeric_limits<std::int16_t>::min();
constexpr std::int64_t kMostAdd = std::numeric_limits<std::int16_t>::max();
constexpr std::size_t kMostSteps = std::numeric_limits<std::uint16_t>::max();

std::int64_t floorDivided(std::int64_t value, std::int64_t by) {
  return value / by - (value % by < 0 ? 1 : 0);
}

std::int64_t ceilDivided(std::int64_t value, std::int64_t by) {
  return value / by + (value % by > 0 ? 1 : 0);
}

}  // namespace

std::int64_t tickOf(const StepRun& run, std::int64_t before, std::uint32_t i) {
  const auto n = std::int64_t{i};
  return before + n * run.interval + run.add * (n * (n - 1) / 2);
}

StepCompressor::StepCompressor(std::int64_t error) : error_(error) {
  // After the second step an A has a range of 2 (3 times the error) + 2 error; see next().
  candidates_.reserve(static_cast<std::size_t>(8 * error + 16));
  next_.reserve(candidates_.capacity());
}

std::size_t StepCompressor::next(std::int64_t before, const std::int64_t* ticks, std::size_t count,
                                 StepRun& run) {
  const std::int64_t first_least = std::max<std::int64_t>(1, ticks[0] - error_ - before);
  const std::int64_t first_most = std::min(ticks[0] + error_ - before, kMostInterval);
  // A single step can be as far away as the counter of the firmware reaches, modulo 2^32.
  if (first_least > first_most || count == 1) {
    run = {static_cast<std::uint32_t>(ticks[0] - before), 1, 0};
    return 1;
  }
  // 2 I + A is within the error of the second step.
  const std::int64_t least = ticks[1] - error_ - before;
  const std::int64_t most = ticks[1] + error_ - before;
  candidates_.clear();
  const std::int64_t add_least = std::max(kLeastAdd, least - 2 * first_most);
  const std::int64_t add_most = std::min(kMostAdd, most - 2 * first_least);
  for (std::int64_t add = add_least; add <= add_most; ++add) {
    const Candidate candidate{add, std::max(first_least, ceilDivided(least - add, 2)),
                              std::min(first_most, floorDivided(most - add, 2))};
    if (candidate.least <= candidate.most) candidates_.push_back(candidate);
  }
  if (candidates_.empty()) {
    run = {static_cast<std::uint32_t>(ticks[0] - before), 1, 0};
    return 1;
  }
  std::size_t steps = 2;
  for (; steps < std::min(count, kMostSteps); ++steps) {
    const auto i = static_cast<std::int64_t>(steps) + 1;
    const std::int64_t pairs = i * (i - 1) / 2;
    next_.clear();
    for (const Candidate& candidate : candidates_) {
      const std::int64_t rest = ticks[steps] - before - candidate.add * pairs;
      const Candidate narrower{candidate.add,
                               std::max(candidate.least, ceilDivided(rest - error_, i)),
                               std::min(candidate.most, floorDivided(rest + error_, i))};
      if (narrower.least <= narrower.most) next_.push_back(narrower);
    }
    if (next_.empty()) break;
    candidates_.swap(next_);
  }
  const Candidate& chosen = candidates_[candidates_.size() / 2];
  run = {static_cast<std::uint32_t>((chosen.least + chosen.most) / 2),
         static_cast<std::uint16_t>(steps), static_cast<std::int16_t>(chosen.add)};
  return steps;
}

bool plays(const StepRun& run, std::int64_t before, const std::int64_t* ticks, std::int64_t error) {
  auto time = static_cast<std::uint32_t>(before);
  std::uint32_t interval = run.interval;
  for (std::uint32_t i = 0; i < run.count; ++i) {
    time += interval;
    interval += static_cast<std::uint32_t>(std::int32_t{run.add});
    const auto off = static_cast<std::int32_t>(time - static_cast<std::uint32_t>(ticks[i]));
    if (std::abs(std::int64_t{off}) > error) return false;
  }
  return true;
}

}  // namespace stepdriver::klipper
