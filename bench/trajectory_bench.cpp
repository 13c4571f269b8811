#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "machine/disposer.h"
#include "support/allocations.h"
#include "trajectory/prepared_trajectory.h"

// Measures long trajectories: preparing one, in the client's thread; and joining, holding, resuming
// and running one at another speed, while the machine waits for that.

namespace stepdriver::bench {
namespace {

using motion::PathAxis;
using motion::PathStart;
using motion::PreparedTrajectory;
using motion::SharedPath;
using motion::TrajectoryPoint;

constexpr double kPointEvery = 0.010;  // s

/// 80 microsteps/mm, 100 mm/s, 1 m/s^2, 20 m/s^3.
PathAxis axisOf(const char* name, double backlash) {
  constexpr double kScale = 80'000.0;
  PathAxis axis;
  axis.name = name;
  axis.microsteps = 16;
  axis.steps_per_unit = kScale;
  axis.configured_backlash = backlash;
  axis.backlash = std::llround(backlash * kScale);
  axis.limits = {0.0, 0.1 * kScale, kScale, kScale, 20.0 * kScale};
  axis.stop_limits = axis.limits;
  return axis;
}

std::vector<PathAxis> axesOf(std::size_t count, double backlash) {
  const char* const names[] = {"x", "y", "z"};
  std::vector<PathAxis> axes;
  for (std::size_t i = 0; i < count; ++i) axes.push_back(axisOf(names[i], backlash));
  return axes;
}

/// Each axis swings like the third power of a sine, which begins and ends at rest; the second and
/// third axes are slower.
std::vector<TrajectoryPoint> pointsFor(std::size_t axes, int count) {
  const double pi = std::acos(-1.0);
  const double duration = kPointEvery * count;
  std::vector<TrajectoryPoint> points;
  for (int i = 1; i <= count; ++i) {
    TrajectoryPoint point;
    point.time = kPointEvery * i;
    for (std::size_t k = 0; k < axes; ++k) {
      const double rounds = std::round(duration / (4.0 + static_cast<double>(k)));
      const double w = 2.0 * pi * rounds / duration;
      const double s = std::sin(w * point.time);
      const double c = std::cos(w * point.time);
      const double way = 0.030;  // m
      const bool last = i == count;
      point.positions.push_back(last ? 0.0 : way * s * s * s);
      point.velocities.push_back(last ? 0.0 : way * w * 3.0 * s * s * c);
      point.accelerations.push_back(last ? 0.0 : way * w * w * (6.0 * s * c * c - 3.0 * s * s * s));
    }
    points.push_back(point);
  }
  return points;
}

std::shared_ptr<const PreparedTrajectory> prepared(std::size_t axes, int count, double backlash) {
  return std::make_shared<const PreparedTrajectory>(axesOf(axes, backlash), pointsFor(axes, count),
                                                    std::vector<motion::MotionState>(axes));
}

void prepare(benchmark::State& state, std::size_t axes, double backlash) {
  const int count = static_cast<int>(state.range(0));
  const std::vector<TrajectoryPoint> points = pointsFor(axes, count);
  for (auto round : state) {
    PreparedTrajectory trajectory(axesOf(axes, backlash), points,
                                  std::vector<motion::MotionState>(axes));
    benchmark::DoNotOptimize(&trajectory);
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK_CAPTURE(prepare, backlash, 1, 0.0005)
    ->Name("Trajectory/prepare_backlash")
    ->Arg(30'000)
    ->Iterations(1);
BENCHMARK_CAPTURE(prepare, three, 3, 0.0)
    ->Name("Trajectory/prepare_three_axes")
    ->Arg(300'000)
    ->Iterations(1);

/// A trajectory under way, far from its beginning.
class UnderWay {
 public:
  static UnderWay& longOne() {
    static UnderWay all(300'000, 0.0);
    return all;
  }
  static UnderWay& longOneWithBacklash() {
    static UnderWay all(300'000, 0.0005);
    return all;
  }

  std::shared_ptr<const SharedPath> join() const {
    return PreparedTrajectory::join(trajectory_, starts_);
  }
  /// All three axes along a path that continues at rate 1 from a given place.
  template <typename Plan>
  void plan(benchmark::State& state, double rate, const Plan& plan) const {
    constexpr double kPlaces[] = {1234.5671, 1235.1113, 1236.0071, 1500.9};
    int i = 0;
    for (auto round : state) {
      const motion::Profile path = plan(*path_, motion::MotionState{kPlaces[i++ % 4], rate, 0.0});
      for (std::size_t member = 0; member < 3; ++member) {
        benchmark::DoNotOptimize(path_->profileOf(member, path));
      }
    }
    state.SetItemsProcessed(state.iterations());
  }

 private:
  UnderWay(int count, double backlash)
      : trajectory_(prepared(3, count, backlash)), starts_(3), path_(join()) {}

  std::shared_ptr<const PreparedTrajectory> trajectory_;
  std::vector<PathStart> starts_;
  std::shared_ptr<const SharedPath> path_;
};

void join(benchmark::State& state, UnderWay& (*trajectory)()) {
  UnderWay& all = trajectory();
  for (auto round : state) benchmark::DoNotOptimize(all.join());
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK_CAPTURE(join, plain, UnderWay::longOne)->Name("Trajectory/join");
BENCHMARK_CAPTURE(join, backlash, UnderWay::longOneWithBacklash)->Name("Trajectory/join_backlash");

void speedOverride(benchmark::State& state) {
  UnderWay::longOne().plan(state, 1.0, [](const auto& path, const motion::MotionState& from) {
    return path.plan(0, from, 0.5);
  });
}
void hold(benchmark::State& state) {
  UnderWay::longOne().plan(state, 1.0, [](const auto& path, const motion::MotionState& from) {
    return path.planStop(0, from);
  });
}
void resume(benchmark::State& state) {
  UnderWay::longOne().plan(state, 0.0, [](const auto& path, const motion::MotionState& from) {
    return path.plan(0, from, 1.0);
  });
}
BENCHMARK(speedOverride)->Name("Trajectory/override");
BENCHMARK(hold)->Name("Trajectory/hold");
BENCHMARK(resume)->Name("Trajectory/resume");

/// Memory that is still in use after the last user of a trajectory has released it.
void memory(benchmark::State& state) {
  const std::int64_t before = allocatedNow();
  std::int64_t used = 0;
  for (auto round : state) {
    {
      machine::Disposer disposer(true);
      const std::vector<PathStart> starts(3);
      auto trajectory = disposer.keep<PreparedTrajectory>(prepared(3, 300'000, 0.0));
      auto path = PreparedTrajectory::join(trajectory, starts);
      trajectory.reset();
      const motion::Profile run = path->profileOf(0, path->plan(0, path->begin(), 1.0));
      path.reset();
      used = allocatedNow() - before;
    }
  }
  const std::int64_t left = allocatedNow() - before;
  state.counters["used_mb"] = static_cast<double>(used) / 1e6;
  state.counters["left_bytes"] = static_cast<double>(left);
  if (left > 1'000'000) state.SkipWithError("the memory of a trajectory is not freed");
}
BENCHMARK(memory)->Name("Trajectory/memory")->Iterations(1);

}  // namespace
}  // namespace stepdriver::bench
