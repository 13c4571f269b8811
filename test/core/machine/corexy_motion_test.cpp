#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/corexy_bench.h"

// Each step of a motor that two axes share is where the sum of their motions crosses a half-step
// line. The motions are textbook formulas here, in long doubles.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::coreXyAxes;
using test::violationsOf;

constexpr long double kSteps = 80'000.0L;  // microsteps/m
constexpr long double kLead =
    1e-3L + 4e-7L;  // s from a request to its motion: 1 ms, and DIR's times

/// One axis in phases of constant jerk, one after the other, and at rest before and after them.
class Course {
 public:
  explicit Course(long double start = 0.0L) : start_(start) {}

  void add(long double duration, long double a, long double j = 0.0L) {
    phases_.push_back({duration, p_, v_, a, j});
    const Phase& last = phases_.back();
    p_ = last.position(duration);
    v_ = last.velocity(duration);
  }

  static Course trapezoid(long double start, long double way, long double speed, long double a) {
    const long double sign = way < 0.0L ? -1.0L : 1.0L;
    Course course(start);
    course.add(speed / a, sign * a);
    course.add(std::abs(way) / speed - speed / a, 0.0L);
    course.add(speed / a, -sign * a);
    return course;
  }

  static Course sCurve(long double start, long double way, long double speed, long double a,
                       long double j) {
    Course course(start);
    const long double bend = a / j;
    const long double ramp = speed / a + bend;
    course.add(bend, 0.0L, j);
    course.add(ramp - 2.0L * bend, a);
    course.add(bend, a, -j);
    course.add(way / speed - ramp, 0.0L);
    course.add(bend, 0.0L, -j);
    course.add(ramp - 2.0L * bend, -a);
    course.add(bend, -a, j);
    return course;
  }

  struct State {
    long double position = 0.0L;
    long double velocity = 0.0L;
  };
  State at(long double time) const {
    long double t = time - start_;
    if (t <= 0.0L || phases_.empty()) return {};
    for (const Phase& phase : phases_) {
      if (t <= phase.duration) return {phase.position(t), phase.velocity(t)};
      t -= phase.duration;
    }
    return {p_, 0.0L};
  }

 private:
  struct Phase {
    long double duration, p, v, a, j;
    long double position(long double t) const {
      return p + t * (v + t * (a / 2.0L + t * j / 6.0L));
    }
    long double velocity(long double t) const { return v + t * (a + t * j / 2.0L); }
  };
  long double start_;
  long double p_ = 0.0L;
  long double v_ = 0.0L;
  std::vector<Phase> phases_;
};

class CoreXyMotion : public testing::Test {
 protected:
  explicit CoreXyMotion(std::vector<config::AxisConfig> axes = coreXyAxes()) : bench(axes) {
    for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
  }

  long double now() { return static_cast<long double>(bench.clock.now()) * 1e-9L; }
  void advance(double seconds) { bench.machine->advance(seconds); }
  void awaitRest() {
    for (int i = 0; i < 100'000; ++i) {
      if (!bench.axis("x").state().moving && !bench.axis("y").state().moving) return;
      advance(1e-3);
    }
    FAIL() << "they still move";
  }

  /// Each step of the motor with the pins of an axis is at most 1 ns from where the sum of the
  /// courses crosses its line.
  void expectSteps(const std::string& pins, const Course& x, const Course& y, long double y_sign) {
    const sim::MemoryTrace& trace = *bench.trace;
    const int step = trace.pin(pins, "step");
    const int dir = trace.pin(pins, "dir");
    bool forward = trace.levels()[static_cast<std::size_t>(dir)];
    std::int64_t count = 0;
    std::int64_t steps = 0;
    for (const sim::MemoryTrace::Edge& edge : trace.edges()) {
      if (edge.pin == dir) forward = edge.level;
      if (edge.pin != step || !edge.level) continue;
      const long double time = static_cast<long double>(edge.time_ns) * 1e-9L;
      const Course::State of_x = x.at(time);
      const Course::State of_y = y.at(time);
      const long double place = (of_x.position + y_sign * of_y.position) * kSteps;
      const long double speed = (of_x.velocity + y_sign * of_y.velocity) * kSteps;
      const long double line = static_cast<long double>(count) + (forward ? 0.5L : -0.5L);
      ASSERT_NEAR(static_cast<double>(place - line), 0.0,
                  static_cast<double>(std::abs(speed) * 1e-9L + 1e-7L))
          << pins << ", step " << steps << " to " << count << (forward ? " up" : " down");
      count += forward ? 1 : -1;
      ++steps;
    }
    const long double end = (x.at(1e6L).position + y_sign * y.at(1e6L).position) * kSteps;
    EXPECT_NEAR(static_cast<double>(count), static_cast<double>(end), 0.5) << pins;
    EXPECT_GT(steps, 100);
  }

  void expectExact(const Course& x, const Course& y) {
    expectSteps("x", x, y, 1.0L);
    expectSteps("y", x, y, -1.0L);
    EXPECT_EQ(violationsOf(bench.report("x")), "");
    EXPECT_EQ(violationsOf(bench.report("y")), "");
    EXPECT_EQ(bench.machine->figures().slips, 0U);
  }

  Bench bench;
};

TEST_F(CoreXyMotion, MovesOfTheTwoAxesAtDifferentTimes) {
  bench.axis("x").moveTo(0.05);
  const Course x = Course::trapezoid(now() + kLead, 0.05L, 0.1L, 1.0L);
  advance(0.123456789);
  // Motor b turns while both axes move.
  bench.axis("y").moveTo(0.04, false, 0.07);
  const Course y = Course::trapezoid(now() + kLead, 0.04L, 0.07L, 1.0L);
  awaitRest();
  expectExact(x, y);
  EXPECT_EQ(bench.axis("x").state().position, 0.05);
  EXPECT_EQ(bench.axis("y").state().position, 0.04);
}

TEST_F(CoreXyMotion, AnAxisIsGivenAnotherTargetAtSpeed) {
  bench.axis("y").moveTo(-0.06);
  const Course y = Course::trapezoid(now() + kLead, -0.06L, 0.1L, 1.0L);
  advance(0.0317);
  bench.axis("x").moveTo(0.03);
  const Course x = Course::trapezoid(now() + kLead, 0.06L, 0.1L, 1.0L);
  advance(0.15);
  bench.axis("x").moveTo(0.06);  // it cruises, and continues at that speed
  awaitRest();
  expectExact(x, y);
}

class CoreXySCurves : public CoreXyMotion {
 protected:
  static std::vector<config::AxisConfig> smoothAxes() {
    std::vector<config::AxisConfig> axes = coreXyAxes();
    for (config::AxisConfig& axis : axes) axis.jerk = 20.0;
    return axes;
  }
  CoreXySCurves() : CoreXyMotion(smoothAxes()) {}
};

TEST_F(CoreXySCurves, OfTheTwoAxes) {
  bench.axis("y").moveTo(0.08);
  const Course y = Course::sCurve(now() + kLead, 0.08L, 0.1L, 1.0L, 20.0L);
  advance(0.2);
  bench.axis("x").moveTo(0.05);
  const Course x = Course::sCurve(now() + kLead, 0.05L, 0.1L, 1.0L, 20.0L);
  awaitRest();
  expectExact(x, y);
}

TEST_F(CoreXyMotion, AlongALine) {
  bench.machine->moveLine({{"x", "y"}, {0.04, -0.03}});
  const long double start = now() + kLead;
  // Along the line as fast as x allows.
  awaitRest();
  const Course x = Course::trapezoid(start, 0.04L, 0.1L, 1.0L);
  const Course y = Course::trapezoid(start, -0.03L, 0.075L, 0.75L);
  expectExact(x, y);
}

TEST_F(CoreXyMotion, AlongATrajectory) {
  motion::TrajectoryRequest request;
  request.names = {"x", "y"};
  request.points.resize(2);
  request.points[0].time = 0.5;
  request.points[0].positions = {0.02, -0.01};
  request.points[0].velocities = {0.05, 0.0};
  request.points[1].time = 1.0;
  request.points[1].positions = {0.03, 0.01};
  request.points[1].velocities = {0.0, 0.0};
  bench.machine->followTrajectory(request);
  const long double start = now() + kLead;
  awaitRest();
  // The cubic with these positions and velocities at both ends.
  const auto cubics = [start](std::vector<long double> p, std::vector<long double> v) {
    Course course(start);
    const long double h = 0.5L;
    for (std::size_t i = 0; i + 1 < p.size(); ++i) {
      const long double slope = (p[i + 1] - p[i]) / h;
      course.add(h, (6.0L * slope - 4.0L * v[i] - 2.0L * v[i + 1]) / h,
                 (6.0L * v[i] + 6.0L * v[i + 1] - 12.0L * slope) / (h * h));
    }
    return course;
  };
  expectExact(cubics({0.0L, 0.02L, 0.03L}, {0.0L, 0.05L, 0.0L}),
              cubics({0.0L, -0.01L, 0.01L}, {0.0L, 0.0L, 0.0L}));
}

TEST_F(CoreXyMotion, AHoldStopsBothAndResumesBoth) {
  const axis::Move x = bench.axis("x").moveTo(0.05);
  const axis::Move y = bench.axis("y").moveTo(-0.03);
  advance(0.2);
  bench.machine->hold();
  awaitRest();
  const std::int64_t held = bench.pulses("x");
  advance(1.0);
  EXPECT_EQ(bench.pulses("x"), held);
  bench.machine->resume();
  EXPECT_EQ(bench.axis("x").wait(x).end, MoveEnd::kReached);
  EXPECT_EQ(bench.axis("y").wait(y).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 1600);
  EXPECT_EQ(bench.pulses("y"), 6400);
}

TEST_F(CoreXyMotion, AStopOfOneAxisLeavesTheOtherItsTarget) {
  bench.axis("x").moveTo(0.05);
  const axis::Move y = bench.axis("y").moveTo(-0.05);
  advance(0.2);
  bench.axis("x").stop();
  EXPECT_EQ(bench.axis("y").wait(y).end, MoveEnd::kReached);
  EXPECT_FALSE(bench.axis("x").state().moving);
  EXPECT_LT(bench.axis("x").state().position, 0.05);
  EXPECT_NEAR(bench.report("x").carriage, 1e3 * bench.axis("x").state().position, 1e-9);
  EXPECT_NEAR(bench.report("y").carriage, -50.0, 1e-9);
  EXPECT_TRUE(bench.axis("x").state().position_valid);
}

TEST_F(CoreXyMotion, AJogOfOneAxisWhileTheOtherMoves) {
  bench.axis("x").jog(0.03);
  advance(0.3);
  const axis::MoveResult moved = bench.move(0.02, "y");
  EXPECT_EQ(moved.end, MoveEnd::kReached);
  EXPECT_NEAR(bench.axis("x").state().velocity, 0.03, 1e-9);
  bench.axis("x").jog(0.0);
  awaitRest();
  const std::int64_t a = bench.pulses("x");
  const std::int64_t b = bench.pulses("y");
  EXPECT_EQ(a - b, 2 * 1600);
  EXPECT_EQ(bench.axis("x").state().position, static_cast<double>(a + b) / 2.0 / 80'000.0);
  EXPECT_EQ(violationsOf(bench.report("x")), "");
  EXPECT_EQ(violationsOf(bench.report("y")), "");
}

}  // namespace
}  // namespace stepdriver
