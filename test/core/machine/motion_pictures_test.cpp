#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "sim/rotor_model.h"
#include "sim/spring_mass.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/motion_trace.h"

// The motions of docs/motion.md: its statements are compared with the edges here, and
// scripts/motion_pictures.sh draws its pictures from the same edges. 1000 steps/m.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::linearAxis;
using test::MotionTrace;

/// 1000 steps/s, 2000 steps/s^2, no soft limits.
config::AxisConfig config(const std::string& name = "x") {
  config::AxisConfig config = linearAxis(name, 1000.0, 1.0, 2.0);
  config.endstop_min.reset();
  config.endstop_max.reset();
  return config;
}

class MotionPictures : public testing::Test {
 protected:
  void build(const std::vector<config::AxisConfig>& axes) { build(axes, Bench::rigAxes(axes)); }
  void build(const std::vector<config::AxisConfig>& axes,
             const std::vector<sim::RigAxisSpec>& rig) {
    bench = std::make_unique<Bench>(axes, rig);
    trace = std::make_unique<MotionTrace>(*bench);
  }

  axis::Axis& x() { return bench->axis("x"); }
  void advance(double seconds) { bench->machine->advance(seconds); }
  void advanceTo(double time) { advance(time - trace->now()); }
  void awaitRest() {
    for (const auto& axis : bench->machine->axes()) {
      while (axis->state().moving) advance(1e-4);
    }
  }
  void holdDuring(double begin, double end) {
    advanceTo(begin);
    trace->mark("hold");
    bench->machine->hold();
    awaitRest();
    advanceTo(end);
    trace->mark("resume");
    bench->machine->resume();
  }
  double takes(double position) {
    const axis::Move move = x().moveTo(position);
    const axis::MoveResult result = x().wait(move);
    EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
    EXPECT_NEAR(result.duration, move.duration, 1e-8);
    return result.duration;
  }
  /// From the step before which the speed was `from` to the step after which it is `to`.
  double timeOfChange(double from, double to) const {
    constexpr double kSame = 1e-3;
    const std::vector<MotionTrace::Step> all = trace->steps("x");
    double begin = 0.0;
    for (std::size_t i = 1; i < all.size(); ++i) {
      const double speed = 1.0 / (all[i].time - all[i - 1].time);
      if (std::abs(speed - from) < kSame) begin = all[i].time;
      if (begin > 0.0 && std::abs(speed - to) < kSame) return all[i - 1].time - begin;
    }
    return -1.0;
  }

  std::unique_ptr<Bench> bench;
  std::unique_ptr<MotionTrace> trace;
};

TEST_F(MotionPictures, HalfStepLines) {
  build({config()});
  const double took = takes(0.008);
  EXPECT_NEAR(took, 2.0 * std::sqrt(8.0 / 2000.0), 1e-9);
  const std::vector<MotionTrace::Step> steps = trace->steps("x");
  ASSERT_EQ(steps.size(), 8U);
  const double begin = steps[0].time - std::sqrt(2.0 * 0.5 / 2000.0);
  for (std::size_t k = 0; k < 4; ++k) {
    const double at = std::sqrt(2.0 * (static_cast<double>(k) + 0.5) / 2000.0);
    EXPECT_NEAR(steps[k].time - begin, at, 2e-9) << k;
    EXPECT_NEAR(steps[7 - k].time - begin, took - at, 2e-9) << 7 - k;
  }
  trace->keep("half_steps");
}

TEST_F(MotionPictures, Trapezoid) {
  config::AxisConfig with_start_speed = config();
  with_start_speed.start_speed = 0.1;
  with_start_speed.deceleration = 4.0;
  build({with_start_speed});
  EXPECT_NEAR(takes(1.0), 0.45 + 0.62875 + 0.225, 1e-8);
  EXPECT_NEAR(trace->speedAt("x", 0.8), 1000.0, 1e-2);
  trace->keep("trapezoid");
}

TEST_F(MotionPictures, Triangle) {
  config::AxisConfig with_start_speed = config();
  with_start_speed.start_speed = 0.1;
  with_start_speed.deceleration = 4.0;
  build({with_start_speed});
  const double peak = std::sqrt(100.0 * 100.0 + 2.0 * 200.0 / (1.0 / 2000.0 + 1.0 / 4000.0));
  EXPECT_NEAR(takes(0.2), (peak - 100.0) / 2000.0 + (peak - 100.0) / 4000.0, 1e-8);
  trace->keep("triangle");
}

TEST_F(MotionPictures, SCurve) {
  config::AxisConfig smooth = config();
  smooth.jerk = 20.0;
  build({smooth});
  EXPECT_NEAR(takes(1.0), 1.6, 1e-8);
  EXPECT_NEAR(trace->speedAt("x", 0.8), 1000.0, 1e-2);
  trace->keep("s_curve");
  // Shorter moves, and back again: too short to reach the speed, or even the acceleration.
  EXPECT_NEAR(takes(0.75), 2.0 * ((std::sqrt(0.51) - 0.1) / 2.0 + 0.1), 1e-8);
  EXPECT_NEAR(takes(0.73), 4.0 * std::cbrt(20.0 / (2.0 * 20'000.0)), 1e-8);
}

TEST_F(MotionPictures, SpeedOverride) {
  build({config()});
  const axis::Move move = x().moveTo(2.0);
  advanceTo(1.0);
  trace->mark("override 0.25");
  bench->machine->setSpeedOverride(0.25);
  advanceTo(2.0);
  trace->mark("override 1");
  bench->machine->setSpeedOverride(1.0);
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReached);
  // A change begins and ends between two steps.
  EXPECT_NEAR(timeOfChange(1000.0, 250.0), 0.375, 0.005);
  EXPECT_NEAR(timeOfChange(250.0, 1000.0), 0.375, 0.005);
  trace->keep("speed_override");
}

TEST_F(MotionPictures, NewTargetBehind) {
  build({config()});
  x().moveTo(5.0);
  advanceTo(1.001);
  trace->mark("target 900");
  const axis::Move back = x().moveTo(0.9);
  EXPECT_NEAR(back.overshoot, 0.101, 1e-6);
  EXPECT_EQ(x().wait(back).end, MoveEnd::kReached);
  EXPECT_EQ(bench->report().pulses_forward, 1001);
  EXPECT_EQ(bench->report().pulses_backward, 101);
  trace->keep("new_target");
}

TEST_F(MotionPictures, Stop) {
  config::AxisConfig stopping = config();
  stopping.stop_deceleration = 4.0;
  build({stopping});
  const axis::Move move = x().moveTo(5.0);
  advanceTo(1.0);
  trace->mark("stop");
  x().stop();
  const axis::MoveResult result = x().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kStopped);
  // At 750 steps when the stop begins, a millisecond later; 1000^2/(2 4000) = 125 to rest.
  EXPECT_NEAR(result.position, 0.875, 0.0015);
  EXPECT_NEAR(trace->steps("x").back().time, 1.001 + 0.25, 0.03);
  trace->keep("stop");
}

TEST_F(MotionPictures, Jog) {
  config::AxisConfig smooth = config();
  smooth.jerk = 20.0;
  build({smooth});
  const std::vector<std::pair<double, double>> jogs{
      {0.0, 0.6}, {0.9, 1.0}, {1.8, -0.6}, {3.1, 0.0}};
  for (const auto& [time, velocity] : jogs) {
    advanceTo(time);
    const auto steps = static_cast<int>(std::lround(velocity * 1000.0));
    trace->mark("jog " + std::to_string(steps));
    x().jog(velocity);
  }
  awaitRest();
  EXPECT_NEAR(trace->speedAt("x", 0.85), 600.0, 1e-2);
  EXPECT_NEAR(trace->speedAt("x", 1.75), 1000.0, 1e-2);
  EXPECT_NEAR(trace->speedAt("x", 3.05), -600.0, 1e-2);
  trace->keep("jog");
}

TEST_F(MotionPictures, LineWithHold) {
  build({config("x"), config("y")});
  const auto line = bench->machine->moveLine({{"x", "y"}, {1.0, 0.4}});
  holdDuring(0.7, 1.6);
  EXPECT_EQ(bench->machine->wait(line).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 1000);
  EXPECT_EQ(bench->pulses("y"), 400);
  EXPECT_NEAR(trace->speedAt("x", 0.65), 1000.0, 1e-2);
  EXPECT_NEAR(trace->speedAt("y", 0.65), 400.0, 1e-2);
  // When y steps, x is at 2.5 times its position, within the half step by which each may be off.
  const std::vector<MotionTrace::Step> of_x = trace->steps("x");
  for (const MotionTrace::Step& step : trace->steps("y")) {
    std::int64_t count = 0;
    for (const MotionTrace::Step& other : of_x) {
      if (other.time <= step.time) count = other.count;
    }
    ASSERT_NEAR(static_cast<double>(count), 2.5 * (static_cast<double>(step.count) - 0.5), 0.51);
  }
  trace->keep("line");
}

/// Two points. With accelerations the segments are quintics, without them cubics.
motion::TrajectoryRequest points(bool with_accelerations) {
  motion::TrajectoryRequest request{{"x"}, {{1.0, {0.4}, {0.6}, {}}, {2.0, {0.8}, {0.0}, {}}}};
  if (with_accelerations) {
    for (motion::TrajectoryPoint& point : request.points) point.accelerations = {0.0};
  }
  return request;
}

TEST_F(MotionPictures, Splines) {
  for (const bool with_accelerations : {false, true}) {
    config::AxisConfig fast = config();
    fast.acceleration = fast.deceleration = 10.0;
    build({fast});
    const auto move = bench->machine->followTrajectory(points(with_accelerations));
    EXPECT_NEAR(move.duration, 2.0, 1e-9);
    EXPECT_EQ(bench->machine->wait(move).end, MoveEnd::kReached);
    EXPECT_EQ(bench->pulses("x"), 800);
    trace->keep(with_accelerations ? "quintics" : "cubics");
  }
}

TEST_F(MotionPictures, TrajectoryWithHold) {
  std::vector<config::AxisConfig> axes{config("x"), config("y")};
  for (config::AxisConfig& axis : axes) axis.acceleration = axis.deceleration = 10.0;
  build(axes);
  const auto move = bench->machine->followTrajectory(
      {{"x", "y"}, {{1.0, {0.4, 0.3}, {0.6, 0.0}, {}}, {2.0, {0.8, 0.0}, {0.0, 0.0}, {}}}});
  holdDuring(0.8, 1.5);
  EXPECT_EQ(bench->machine->wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 800);
  EXPECT_EQ(bench->pulses("y"), 0);
  trace->keep("trajectory_hold");
}

TEST_F(MotionPictures, InputShaper) {
  constexpr double kFrequency = 8.0;
  std::vector<config::AxisConfig> axes{config("x"), config("y")};
  for (config::AxisConfig& axis : axes) axis.acceleration = axis.deceleration = 20.0;
  axes[1].input_shaper = {{config::ShaperType::kZv, kFrequency, 0.0}};
  build(axes);
  const axis::Move as_planned = x().moveTo(0.4);
  const axis::Move shaped = bench->axis("y").moveTo(0.4);
  EXPECT_NEAR(as_planned.duration, 0.45, 1e-9);
  EXPECT_NEAR(shaped.duration, 0.45 + 0.5 / kFrequency, 1e-9);
  awaitRest();
  const auto ringing = [this](const std::string& name) {
    sim::SpringMass mass(kFrequency, 0.0, 0.0);
    for (const MotionTrace::Step& step : trace->steps(name)) {
      mass.moveTo(static_cast<double>(step.count), std::llround(step.time * 1e9));
    }
    return mass.ringing(1'000'000'000);
  };
  // The first jump of the acceleration alone makes 20,000/(2 pi 8)^2 steps, and is followed by
  // another one 50 ms later.
  EXPECT_GT(ringing("x"), 15.0);
  EXPECT_LT(ringing("y"), 1.0);
  trace->keep("input_shaper");
}

constexpr int kMicrosteps = 16;
constexpr double kDegrees = 180.0 / 3.14159265358979323846;

/// A motor of 0.1 Nm with a heavy load: it can accelerate by at most 159,000 full steps/s^2.
sim::MotorSpec weakMotor() {
  sim::MotorSpec motor;
  motor.holding_torque = 0.1;
  motor.inertia = 200e-7;
  motor.damping = 0.05;
  return motor;
}

/// 80 full steps at up to 1000 full steps/s.
config::AxisConfig fastAxis(double acceleration) {
  config::AxisConfig fast = config();
  fast.max_speed = kMicrosteps * 1.0;
  fast.acceleration = fast.deceleration = kMicrosteps * acceleration / 1000.0;
  return fast;
}

class RotorPictures : public MotionPictures {
 protected:
  /// @return what the rig has seen until the rotor is at rest.
  sim::RigAxisReport move(double acceleration) {
    const config::AxisConfig fast = fastAxis(acceleration);
    std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({fast});
    rig.front().motor = weakMotor();
    build({fast}, rig);
    takes(kMicrosteps * 0.08);
    advance(1.0);
    EXPECT_EQ(bench->pulses("x"), kMicrosteps * 80);
    return bench->report("x");
  }

  /// Adds field and rotor to the trace, both in full steps, as the edges turn them.
  void addRotor() {
    sim::RotorModel rotor(weakMotor());
    std::vector<std::pair<double, double>> field;
    std::vector<std::pair<double, double>> follower;
    std::vector<std::pair<double, double>> lag;
    std::int64_t behind = 0;
    std::int64_t count = 0;
    const std::vector<MotionTrace::Step> steps = trace->steps("x");
    const double begin = steps.front().time;
    rotor.rest(0);
    std::size_t next = 0;
    for (int sample = 0; sample <= 1500; ++sample) {
      const double time = begin + sample * 1e-4;
      for (; next < steps.size() && steps[next].time <= time; ++next) {
        behind += rotor.turnTo(std::llround(steps[next].time * 1e9));
        rotor.moveField(90.0 / kDegrees / kMicrosteps *
                        static_cast<double>(steps[next].count - count));
        count = steps[next].count;
      }
      behind += rotor.turnTo(std::llround(time * 1e9));
      field.emplace_back(time - begin, static_cast<double>(count) / kMicrosteps);
      lag.emplace_back(time - begin, rotor.lag() * kDegrees);
      follower.emplace_back(time - begin, field.back().second - lag.back().second / 90.0 -
                                              4.0 * static_cast<double>(behind));
    }
    trace->add("field", field);
    trace->add("rotor", follower);
    trace->add("lag", lag);
  }
};

TEST_F(RotorPictures, Follows) {
  const sim::RigAxisReport seen = move(40'000.0);
  EXPECT_EQ(seen.lost_steps, 0);
  EXPECT_NEAR(seen.carriage, kMicrosteps * 80.0, 1e-9) << "mm, at a step/mm";
  // 40,000 of 159,000 full steps/s^2: 15 degrees, and twice that as the ramp begins at once. The
  // damping takes 18 at full speed.
  EXPECT_NEAR(seen.largest_lag, 50.0, 8.0);
  addRotor();
  trace->keep("rotor_follows");
}

TEST_F(RotorPictures, FallsOutOfStep) {
  const sim::RigAxisReport seen = move(160'000.0);
  EXPECT_GT(seen.lost_steps, 40);
  EXPECT_EQ(seen.lost_steps % 4, 0);
  EXPECT_EQ(seen.largest_lag, 180.0);
  EXPECT_NEAR(seen.carriage, kMicrosteps * (80.0 - static_cast<double>(seen.lost_steps)), 1e-9);
  addRotor();
  trace->keep("rotor_falls_out");
}

}  // namespace
}  // namespace stepdriver
