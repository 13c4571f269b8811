#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "profile/composition.h"
#include "profile/input_shaper.h"
#include "profile/profile_sum.h"
#include "profile/shaped_profile.h"
#include "profile/step_finder.h"
#include "support/exact_steps.h"
#include "support/plan_from_rest.h"
#include "support/reference_steps.h"
#include "trajectory/spline.h"

// Measures how long finding the next step takes, and how far its time is from the exact one. The
// times are per step (items_per_second); the errors in ns.

namespace stepdriver::bench {
namespace {

using motion::Profile;
using motion::Step;
using motion::StepFinder;

constexpr double kExact = 1.0;  // ns

void report(benchmark::State& state, std::int64_t steps, const StepErrors& errors) {
  state.SetItemsProcessed(state.iterations() * steps);
  state.counters["worst_error_ns"] = errors.worst;
  state.counters["rms_error_ns"] = errors.rms;
}

/// @param exact curve of the axis, whose steps are half-step lines.
StepErrors errorsOf(const Profile& profile, ExactMotion exact) {
  ErrorMeter meter;
  StepFinder finder(profile, 0);
  Step step;
  while (finder.next(step)) {
    meter.add(step.time_ns, exact.crossing(static_cast<long double>(finder.count()) - 0.5L));
  }
  return meter.errors();
}

std::int64_t timesOf(StepFinder finder) {
  std::int64_t sum = 0;
  Step step;
  while (finder.next(step)) sum += step.time_ns;
  return sum;
}

void findSteps(benchmark::State& state, const Profile& profile, const ExactMotion& exact) {
  const auto steps = motion::split(profile.endPosition()).whole;
  const StepErrors errors = errorsOf(profile, exact);
  for (auto round : state) benchmark::DoNotOptimize(timesOf(StepFinder(profile, 0)));
  report(state, steps, errors);
  if (errors.worst > kExact) state.SkipWithError("a step's time is wrong by more than 1 ns");
}

// ---- one axis

constexpr Triangle kTriangle{40'000, 1e6};

void stepsOfRamps(benchmark::State& state) {
  const double speed = 200'000.0;
  const double a = kTriangle.acceleration;
  findSteps(state, motion::planFromRest(0, 0, kTriangle.steps, {0.0, speed, a, a, 0.0}),
            ExactMotion::trapezoid(kTriangle.steps, speed, a, a));
}
BENCHMARK(stepsOfRamps)->Name("NextStep/ramps");

// A usual axis: 16,000 steps/s, reached in half a second.
constexpr std::int64_t kSteps = 40'000;
constexpr double kSpeed = 16'000.0;
constexpr double kAcceleration = 32'000.0;
constexpr double kJerk = 128'000.0;

Profile trapezoid() {
  return motion::planFromRest(0, 0, kSteps, {0.0, kSpeed, kAcceleration, kAcceleration, 0.0});
}
ExactMotion exactTrapezoid() {
  return ExactMotion::trapezoid(kSteps, kSpeed, kAcceleration, kAcceleration);
}

void stepsOfTrapezoid(benchmark::State& state) { findSteps(state, trapezoid(), exactTrapezoid()); }
BENCHMARK(stepsOfTrapezoid)->Name("NextStep/trapezoid");

void stepsOfSCurve(benchmark::State& state) {
  findSteps(state,
            motion::planFromRest(0, 0, kSteps, {0.0, kSpeed, kAcceleration, kAcceleration, kJerk}),
            ExactMotion::sCurve(kSteps, kSpeed, kAcceleration, kJerk));
}
BENCHMARK(stepsOfSCurve)->Name("NextStep/s_curve");

// The phases of a constant jerk alone: an S-curve that reaches neither limit.
void stepsOfJerkPhases(benchmark::State& state) {
  const double a = 64'000.0;
  const double speed = a * a / kJerk;
  const auto steps = static_cast<std::int64_t>(speed * 2.0 * a / kJerk);
  findSteps(state, motion::planFromRest(0, 0, steps, {0.0, 1e9, 1e9, 1e9, kJerk}),
            ExactMotion::sCurve(static_cast<long double>(steps), speed, a, kJerk));
}
BENCHMARK(stepsOfJerkPhases)->Name("NextStep/jerk_only");

// ---- a shaped motion

void stepsOfShaped(benchmark::State& state) {
  const Profile plan = trapezoid();
  const motion::InputShaper shaper = motion::InputShaper::ei(42.0, 0.1);
  const motion::ShapedProfile shaped(plan, shaper, plan.startNs());
  motion::ProfileSum sum;
  for (auto round : state) {
    sum.begin(shaped.startNs());
    sum.add(1.0, shaped);
    benchmark::DoNotOptimize(timesOf(StepFinder(sum, 0)));
  }
  state.SetItemsProcessed(state.iterations() * kSteps);
}
BENCHMARK(stepsOfShaped)->Name("NextStep/shaped");

// ---- a trajectory

void stepsOfCubics(benchmark::State& state) {
  const std::vector<motion::Waypoint> waypoints{
      {1'000'000'000, 8'000.0, 15'000.0, {}},
      {2'000'000'000, 22'000.0, 12'000.0, {}},
      {3'000'000'000, 28'000.0, 0.0, {}},
  };
  ExactMotion exact;
  long double position = 0.0L;
  long double velocity = 0.0L;
  for (const motion::Waypoint& to : waypoints) {  // each segment lasts 1 s
    const long double way = to.position - position;
    const long double end = *to.velocity;
    exact.add(1.0L, 2.0L * (3.0L * way - 2.0L * velocity - end),
              6.0L * (velocity + end - 2.0L * way));
    position = to.position;
    velocity = end;
  }
  findSteps(state, motion::planSpline(0, {}, waypoints), exact);
}
BENCHMARK(stepsOfCubics)->Name("NextStep/cubics");

// ---- straight lines

/// Each axis goes a little less far than the one before; a step of each, in turn.
void stepsOfLine(benchmark::State& state) {
  const Profile path = trapezoid();
  std::vector<Profile> profiles;
  std::vector<StepErrors> errors;
  std::int64_t steps = 0;
  for (std::int64_t axis = 0; axis < state.range(0); ++axis) {
    const std::int64_t way = kSteps - 137 * axis;
    const motion::DoubleDouble scale =
        motion::fromInteger(way) / motion::DoubleDouble(static_cast<double>(kSteps));
    profiles.push_back(motion::scaled(path, 0.0, scale));
    errors.push_back(errorsOf(
        profiles.back(),
        exactTrapezoid().scaled(static_cast<long double>(way) / static_cast<long double>(kSteps))));
    steps += way;
  }
  std::vector<StepFinder> finders;
  for (auto round : state) {
    finders.clear();
    for (const Profile& profile : profiles) finders.emplace_back(profile, 0);
    std::int64_t sum = 0;
    Step step;
    for (bool any = true; any;) {
      any = false;
      for (StepFinder& finder : finders) {
        if (!finder.next(step)) continue;
        any = true;
        sum += step.time_ns;
      }
    }
    benchmark::DoNotOptimize(sum);
  }
  StepErrors all;
  for (const StepErrors& one : errors) {
    all.worst = std::max(all.worst, one.worst);
    all.rms = std::max(all.rms, one.rms);
  }
  report(state, steps, all);
  if (all.worst > kExact) state.SkipWithError("a step's time is wrong by more than 1 ns");
}
BENCHMARK(stepsOfLine)->Name("NextStep/line")->Arg(1)->Arg(2)->Arg(3)->Arg(6);

// ---- other methods

/// Their convention: step n comes when the curve is at n, and down it is the mirror image.
template <typename Steps>
void reference(benchmark::State& state, const Steps& first) {
  const long double half = kTriangle.steps / 2;  // NOLINT(bugprone-integer-division): even
  const auto up = [](long double n) { return std::sqrt(2.0L * n / kTriangle.acceleration); };
  ErrorMeter meter;
  Steps steps = first;
  std::int64_t time_ns = 0;
  for (long double n = 1.0L; steps.next(time_ns); n += 1.0L) {
    meter.add(time_ns, n <= half ? up(n) : 2.0L * up(half) - up(2.0L * half - n));
  }
  for (auto round : state) {
    Steps again = first;
    std::int64_t sum = 0;
    while (again.next(time_ns)) sum += time_ns;
    benchmark::DoNotOptimize(sum);
  }
  report(state, kTriangle.steps, meter.errors());
}

BENCHMARK_CAPTURE(reference, plain, PlainSqrt(kTriangle))->Name("NextStep/plain_sqrt");
BENCHMARK_CAPTURE(reference, float, Avr446Float(kTriangle))->Name("NextStep/avr446_double");
BENCHMARK_CAPTURE(reference, slow, Avr446Integer(kTriangle, 1e6))->Name("NextStep/avr446_1_mhz");
BENCHMARK_CAPTURE(reference, fast, Avr446Integer(kTriangle, 16e6))->Name("NextStep/avr446_16_mhz");

/// The minimum of any method: the root and the division for each step.
void bareSqrt(benchmark::State& state) {
  for (auto round : state) {
    double sum = 0.0;
    for (std::int64_t i = 1; i <= kTriangle.steps; ++i) {
      sum += 1.0 / std::sqrt(static_cast<double>(i));
    }
    benchmark::DoNotOptimize(sum);
  }
  state.SetItemsProcessed(state.iterations() * kTriangle.steps);
}
BENCHMARK(bareSqrt)->Name("NextStep/bare_sqrt");

}  // namespace
}  // namespace stepdriver::bench
