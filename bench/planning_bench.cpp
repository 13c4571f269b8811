#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include "point_to_point/planner.h"
#include "profile/step_finder.h"
#include "support/allocations.h"
#include "trajectory/line_path.h"

// Measures the time and memory that planning a move takes.

namespace stepdriver::bench {
namespace {

using motion::MotionLimits;
using motion::MotionState;

constexpr MotionLimits kTrapezoid{0.0, 16'000.0, 32'000.0, 32'000.0, 0.0};
constexpr MotionLimits kSCurve{0.0, 16'000.0, 32'000.0, 32'000.0, 128'000.0};
constexpr std::int64_t kTarget = 40'000;

void plan(benchmark::State& state, const MotionState& from, const MotionLimits& limits) {
  for (auto round : state) {
    benchmark::DoNotOptimize(motion::planMove(0, from, kTarget, limits));
  }
  state.SetItemsProcessed(state.iterations());
}

const MotionState kMoving{12'345.678, 9'000.0, 11'000.0};
const MotionState kLeaving{38'000.0, -9'000.0, -11'000.0};

BENCHMARK_CAPTURE(plan, t, MotionState{}, kTrapezoid)->Name("Plan/trapezoid");
BENCHMARK_CAPTURE(plan, s, MotionState{}, kSCurve)->Name("Plan/s_curve");
BENCHMARK_CAPTURE(plan, tm, kMoving, kTrapezoid)->Name("Plan/trapezoid_moving");
BENCHMARK_CAPTURE(plan, sm, kMoving, kSCurve)->Name("Plan/s_curve_moving");
BENCHMARK_CAPTURE(plan, sl, kLeaving, kSCurve)->Name("Plan/s_curve_turning");

/// A move to plan.
struct Case {
  MotionState from;
  std::int64_t target = 0;
  MotionLimits limits;
};

/// The kinds of random moves.
enum class Kind { kNoJerkFromRest, kNoJerk, kFromRest, kAny, kTurning };

/// Limits over three decades of the speed; moves of up to several times the longest stop.
Case randomCase(Kind kind, std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto power = [&](double from, double to) {
    return std::pow(10.0, from + (to - from) * unit(random));
  };
  const auto either = [&] { return random() % 2 == 0 ? 1.0 : -1.0; };
  Case one;
  one.limits.max_speed = power(2.0, 5.0);
  one.limits.acceleration = one.limits.max_speed * power(-0.5, 1.5);
  one.limits.deceleration = one.limits.acceleration * power(-0.3, 0.3);
  const bool jerk = kind != Kind::kNoJerk && kind != Kind::kNoJerkFromRest;
  if (jerk) one.limits.jerk = one.limits.acceleration * power(0.0, 2.0);
  const double hardest = std::min(one.limits.acceleration, one.limits.deceleration);
  double stop = one.limits.max_speed * one.limits.max_speed / hardest;
  if (jerk) stop += one.limits.max_speed * hardest / one.limits.jerk;
  const double way = stop * power(-2.0, 0.7) + 1.0;
  const bool rests = kind == Kind::kFromRest || kind == Kind::kNoJerkFromRest;
  const double sign = either();
  one.from.position = std::floor(1e5 * unit(random));
  if (!rests) {
    one.from.velocity = sign * one.limits.max_speed * unit(random);
    if (jerk) one.from.acceleration = either() * hardest * unit(random);
  }
  const double towards = kind == Kind::kTurning ? -sign : kind == Kind::kAny ? either() : sign;
  one.target = std::llround(one.from.position.hi + towards * way);
  return one;
}

void planCase(const Case& one) {
  benchmark::DoNotOptimize(motion::planMove(0, one.from, one.target, one.limits));
}

/// A line of six axes to plan, from rest.
struct Line {
  std::vector<motion::PathAxis> axes;
  std::vector<motion::PathStart> starts;
  std::vector<double> targets;
};

Line randomLine(std::mt19937_64& random) {
  Line line;
  for (const char* name : {"x", "y", "z", "a", "b", "c"}) {
    const Case one = randomCase(Kind::kFromRest, random);
    motion::PathAxis axis;
    axis.name = name;
    axis.microsteps = 16;
    axis.steps_per_unit = 80'000.0;
    axis.limits = one.limits;
    axis.stop_limits = one.limits;
    line.axes.push_back(axis);
    motion::PathStart start;
    start.motor = one.from;
    line.starts.push_back(start);
    line.targets.push_back(static_cast<double>(one.target));
  }
  return line;
}

/// The path, and the motions of its axes.
void planCase(const Line& line) {
  const motion::LinePath path(line.axes, line.starts, line.targets, 0.0, 0.0);
  const motion::Profile profile = path.plan(0, path.begin(), 1.0);
  for (std::size_t i = 0; i < line.axes.size(); ++i) {
    benchmark::DoNotOptimize(path.profileOf(i, profile));
  }
}

/// Each case's shortest time of several, so that only its own work counts.
template <typename AnyCase>
std::vector<double> shortestTimes(const std::vector<AnyCase>& cases) {
  using Clock = std::chrono::steady_clock;
  std::vector<double> shortest(cases.size(), std::numeric_limits<double>::max());
  for (int round = 0; round < 5; ++round) {
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const auto begin = Clock::now();
      planCase(cases[i]);
      const std::chrono::duration<double, std::nano> took = Clock::now() - begin;
      shortest[i] = std::min(shortest[i], took.count());
    }
  }
  return shortest;
}

/// 10,000 random cases: the mean of their shortest times, and the 99th percentile over it.
template <typename MakeCase>
void planRandom(benchmark::State& state, const MakeCase& make) {
  std::mt19937_64 random(1);
  std::vector<decltype(make(random))> cases(10'000);
  for (auto& one : cases) one = make(random);
  for (auto round : state) {
    for (const auto& one : cases) planCase(one);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(cases.size()));
  std::vector<double> times = shortestTimes(cases);
  std::sort(times.begin(), times.end());
  const double mean =
      std::accumulate(times.begin(), times.end(), 0.0) / static_cast<double>(times.size());
  state.counters["mean_ns"] = mean;
  state.counters["p99_over_mean"] = times[times.size() * 99 / 100] / mean;
}

void planMoves(benchmark::State& state, Kind kind) {
  planRandom(state, [kind](std::mt19937_64& random) { return randomCase(kind, random); });
}
void planLines(benchmark::State& state) { planRandom(state, randomLine); }

BENCHMARK_CAPTURE(planMoves, tr, Kind::kNoJerkFromRest)->Name("Plan/random/trapezoid_from_rest");
BENCHMARK_CAPTURE(planMoves, tm, Kind::kNoJerk)->Name("Plan/random/trapezoid");
BENCHMARK_CAPTURE(planMoves, sr, Kind::kFromRest)->Name("Plan/random/s_curve_from_rest");
BENCHMARK_CAPTURE(planMoves, sm, Kind::kAny)->Name("Plan/random/s_curve");
BENCHMARK_CAPTURE(planMoves, st, Kind::kTurning)->Name("Plan/random/s_curve_turning");
BENCHMARK(planLines)->Name("Plan/random/line_of_6");

/// The memory that a plan takes: its pieces, and nothing for each step.
struct Memory {
  Allocations plan;
  Allocations steps;  ///< finding the first steps
};

Memory memoryOf(std::int64_t target, const MotionLimits& limits) {
  Memory memory;
  const Allocations before = allocations();
  const motion::Plan plan = motion::planMove(0, {}, target, limits);
  const Allocations planned = allocations();
  motion::StepFinder finder(plan.profile, 0);
  motion::Step step;
  for (int i = 0; i < 1'000'000 && finder.next(step); ++i) benchmark::DoNotOptimize(step);
  memory.plan = planned - before;
  memory.steps = allocations() - planned;
  return memory;
}

void moveMemory(benchmark::State& state, const MotionLimits& limits) {
  const std::int64_t target = state.range(0);
  // The same phases as a move of 10 steps, at any length: the motion never reaches a limit.
  const Memory shortest = memoryOf(10, limits);
  Memory memory;
  for (auto round : state) memory = memoryOf(target, limits);
  state.counters["bytes"] = static_cast<double>(memory.plan.bytes);
  state.counters["allocations"] = static_cast<double>(memory.plan.count);
  state.counters["allocations_of_steps"] = static_cast<double>(memory.steps.count);
  if (!(memory.plan == shortest.plan)) state.SkipWithError("the memory grows with the move");
  if (memory.steps.count != 0) state.SkipWithError("finding a step takes memory");
}

constexpr MotionLimits kUnbounded{0.0, 1e12, 32'000.0, 32'000.0, 0.0};
constexpr MotionLimits kJerkAlone{0.0, 1e12, 1e12, 1e12, 128'000.0};

void trapezoidMemory(benchmark::State& state) { moveMemory(state, kUnbounded); }
void sCurveMemory(benchmark::State& state) { moveMemory(state, kJerkAlone); }
BENCHMARK(trapezoidMemory)->Name("Memory/trapezoid")->Arg(10)->Arg(1'000'000'000)->Iterations(1);
BENCHMARK(sCurveMemory)->Name("Memory/s_curve")->Arg(10)->Arg(1'000'000'000)->Iterations(1);

}  // namespace
}  // namespace stepdriver::bench
