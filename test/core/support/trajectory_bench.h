#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/differences.h"
#include "support/motion_trace.h"

namespace stepdriver::test {

/// 1000 steps/m, 2 m/s, 10 m/s^2, from -5 m, without a min endstop.
inline config::AxisConfig trajectoryAxis(const std::string& name) {
  config::AxisConfig config = linearAxis(name, 1000.0, 2.0, 10.0);
  config.endstop_min.reset();
  config.min_position = -5.0;
  return config;
}

/// Trajectories of two axes, x and y.
class TrajectoryBench : public testing::Test {
 protected:
  void SetUp() override { build({trajectoryAxis("x"), trajectoryAxis("y")}); }
  void build(const std::vector<config::AxisConfig>& axes) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
    for (sim::RigAxisSpec& spec : specs) spec.max_switch->position = 100'000.0;
    bench = std::make_unique<Bench>(axes, specs);
  }

  test::UnthreadedMachine& machine() { return *bench->machine; }
  machine::CoordinatedMove follow(const motion::TrajectoryRequest& request) {
    return machine().followTrajectory(request);
  }
  axis::AxisState state(const std::string& name) { return bench->axis(name).state(); }
  void advance(double seconds) { machine().advance(seconds); }
  void awaitRest() {
    while (state("x").moving || state("y").moving) advance(1e-4);
  }
  std::vector<Crossing> crossings(const std::string& name) {
    std::vector<Crossing> found;
    std::int64_t before = 0;
    for (const MotionTrace::Step& step : MotionTrace(*bench).steps(name)) {
      found.push_back(
          {std::llround(step.time * 1e9), static_cast<double>(before + step.count) / 2.0});
      before = step.count;
    }
    return found;
  }
  /// What the steps of an axis prove, from steps that are at least `apart` [s] from each other.
  Differences differences(const std::string& name, double apart) {
    return differencesOf(crossings(name), apart);
  }
  /// Once at rest: the chips saw no violation, and the positions are the pulses, except for
  /// backlash.
  void expectClean() {
    for (const std::string name : {"x", "y"}) {
      EXPECT_EQ(violationsOf(bench->report(name)), "") << name;
      const double slack = bench->axis(name).state().slack;
      const double motor = static_cast<double>(bench->pulses(name)) / 1000.0;
      EXPECT_NEAR(state(name).position, motor - slack, 1e-12);
    }
  }

  std::unique_ptr<Bench> bench;
};

}  // namespace stepdriver::test
