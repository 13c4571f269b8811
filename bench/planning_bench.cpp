#include <benchmark/benchmark.h>

#include <cstdint>

#include "motion/planner.h"
#include "motion/step_finder.h"
#include "support/allocations.h"

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
