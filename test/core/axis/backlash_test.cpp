#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/homing_bench.h"
#include "support/refusal.h"

// An axis that loses 30 microsteps at each reversal: 80 microsteps/mm, 1/16.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::linearAxis;
using test::violationsOf;

constexpr std::int64_t kBacklash = 30;

class Backlash : public testing::Test {
 protected:
  void SetUp() override {
    config::AxisConfig config = linearAxis("x");
    config.backlash = kBacklash / config.steps_per_unit;
    bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config, linearAxis("y")});
  }

  axis::Axis& x() { return bench->axis(); }
  /// The motor's position, from the pulses that the rig has counted.
  std::int64_t motor() { return bench->pulses(); }
  double position() { return x().state().position; }
  void moveTo(double position_m) { EXPECT_EQ(bench->move(position_m).end, MoveEnd::kReached); }
  void expectClean() {
    EXPECT_EQ(violationsOf(bench->report()), "");
    EXPECT_EQ(bench->machine->figures().slips, 0U);
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(Backlash, IsTakenUpAtEachReversalAndIsNoPartOfThePosition) {
  moveTo(0.010);
  EXPECT_EQ(motor(), 800 + kBacklash);
  EXPECT_DOUBLE_EQ(position(), 0.010);
  moveTo(0.020);
  EXPECT_EQ(motor(), 1600 + kBacklash);
  moveTo(0.005);
  EXPECT_EQ(motor(), 400);
  EXPECT_DOUBLE_EQ(position(), 0.005);
  moveTo(0.005);
  EXPECT_EQ(motor(), 400);
  moveTo(-0.001);
  EXPECT_EQ(motor(), -80);
  moveTo(0.0);
  EXPECT_EQ(motor(), kBacklash);
  expectClean();
}

TEST_F(Backlash, IsTakenUpForATargetThatComesInTheMiddleOfTakingItUp) {
  for (const std::int64_t off : {-25, -5, 5, 25}) {
    for (const double after : {0.0, 2e-3, 8e-3, 2e-2}) {
      for (const double away : {0.005, 0.015}) {
        SetUp();
        moveTo(0.010);
        x().moveTo(away);
        bench->machine->advance(after);
        const double target = 0.010 + static_cast<double>(off) / 80'000.0;
        const axis::MoveResult result = x().wait(x().moveTo(target));
        EXPECT_EQ(result.end, MoveEnd::kReached);
        EXPECT_NEAR(position(), target, 1e-12)
            << off << " steps after " << after << " s towards " << away;
        expectClean();
      }
    }
  }
}

TEST_F(Backlash, IsNoPartOfWhatAMoveThatTurnsSaysOfItsEnd) {
  for (const double away : {0.1, -0.1}) {
    for (const int off : {-90, -31, -30, -20, -10, -1, 1, 10, 20, 30, 31, 90, 400}) {
      SetUp();
      x().moveTo(away);
      bench->machine->advance(0.15);
      const double target = position() + off / 80'000.0;
      const axis::Move move = x().moveTo(target);
      const axis::MoveResult result = x().wait(move);
      EXPECT_EQ(result.end, MoveEnd::kReached);
      EXPECT_NEAR(move.rest, target, 1e-12) << off << " steps away, towards " << away;
      EXPECT_NEAR(position(), target, 1e-12) << off << " steps away, towards " << away;
      expectClean();
    }
  }
}

TEST_F(Backlash, LetsTheJointStandWhileItIsTakenUp) {
  x().moveTo(0.010);
  std::int64_t taken = 0;
  while (x().state().moving) {
    bench->machine->advance(1e-4);
    const std::int64_t now = motor();
    EXPECT_GE(now, taken);
    taken = now;
    EXPECT_DOUBLE_EQ(position() * 80'000.0,
                     static_cast<double>(std::max<std::int64_t>(0, now - kBacklash)));
    if (now < kBacklash) {
      EXPECT_EQ(x().state().velocity, 0.0);
    }
  }
  expectClean();
}

TEST_F(Backlash, IsThereForATargetThatIsReplacedOnTheWay) {
  x().moveTo(0.050);
  bench->machine->advance(0.3);
  const axis::Move back = x().moveTo(0.010);
  EXPECT_EQ(x().wait(back).end, MoveEnd::kReached);
  EXPECT_EQ(motor(), 800);
  EXPECT_DOUBLE_EQ(position(), 0.010);
  // The axis can't stop before this target, so it returns to it from above.
  x().moveTo(0.050);
  bench->machine->advance(0.3);
  const double passing = position() + 0.001;
  const axis::Move near = x().moveTo(passing);
  EXPECT_GT(near.overshoot, 0.0);
  const axis::MoveResult result = x().wait(near);
  EXPECT_EQ(result.end, MoveEnd::kReached);
  EXPECT_NEAR(result.position, passing, 0.5 / 80'000.0);
  EXPECT_EQ(motor(), std::llround(passing * 80'000.0));
  expectClean();
}

// The joint's farthest position follows from the motor's: upwards all of the backlash is taken up.
TEST_F(Backlash, IsNoPartOfTheOvershootThatAMoveAnnounces) {
  for (const double sign : {1.0, -1.0}) {
    for (const std::int64_t ahead : {10, 29, 31, 80, 250}) {
      SetUp();
      x().moveTo(sign * 0.080);
      bench->machine->advance(0.3);
      const double target = position() + sign * static_cast<double>(ahead) / 80'000.0;
      const axis::Move near = x().moveTo(target);
      std::int64_t farthest = motor();
      while (x().state().moving) {
        bench->machine->advance(0.0005);
        farthest = sign > 0.0 ? std::max(farthest, motor()) : std::min(farthest, motor());
      }
      const std::int64_t joint = sign > 0.0 ? farthest - kBacklash : farthest;
      const double passed = sign * (static_cast<double>(joint) - target * 80'000.0);
      EXPECT_NEAR(near.overshoot * 80'000.0, passed, 1.0)
          << sign << ", " << ahead << " steps ahead";
      EXPECT_NEAR(position(), target, 1e-12);
      expectClean();
    }
  }
}

// The turn back to the target takes the backlash up again, so the motor's end lies before the place
// at which the joint passes its target.
TEST_F(Backlash, DoesNotHideThatLowerLimitsWouldPassTheTarget) {
  for (const double target : {0.004, -0.004}) {
    std::int64_t farthest = 0;
    for (int i = 0; i < 140; ++i) {
      SetUp();
      x().moveTo(target);
      bench->machine->advance(0.001 * i);
      axis::AxisLimits gentle;
      gentle.acceleration = gentle.deceleration = 0.15;
      gentle.jerk = i % 2 == 0 ? 0.0 : 2.5;
      x().setLimits(gentle);
      while (x().state().moving) {
        bench->machine->advance(0.001);
        farthest = target > 0.0 ? std::max(farthest, motor()) : std::min(farthest, motor());
      }
      EXPECT_NEAR(position(), target, 1e-12);
      expectClean();
    }
    EXPECT_EQ(farthest, target > 0.0 ? 320 + kBacklash : -320);
  }
}

TEST_F(Backlash, IsTakenUpBeforeALine) {
  moveTo(0.010);
  const auto line = bench->machine->moveLine({{"x", "y"}, {0.005, 0.010}});
  EXPECT_EQ(bench->machine->wait(line).end, MoveEnd::kReached);
  EXPECT_EQ(motor(), 400);
  EXPECT_EQ(bench->pulses("y"), 800);
  EXPECT_DOUBLE_EQ(position(), 0.005);
  // y waited for x: its first step comes after the last step that takes up the backlash of x.
  const auto x_steps = bench->trace->times("x", "step", true);
  const auto y_steps = bench->trace->times("y", "step", true);
  EXPECT_GT(y_steps.front(), x_steps[800 + 2 * kBacklash - 1]);
  expectClean();
}

TEST_F(Backlash, EndsAJogAtTheSoftLimitOfTheJoint) {
  config::AxisConfig config = linearAxis("x");
  config.backlash = kBacklash / config.steps_per_unit;
  config.max_position = 0.010;
  bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config});
  x().jog(0.05);
  while (x().state().moving) bench->machine->advance(1e-3);
  EXPECT_DOUBLE_EQ(position(), 0.010);
  EXPECT_EQ(motor(), 800 + kBacklash);
  expectClean();
}

// Its homing was stopped beyond the soft limit, to which it comes down.
TEST_F(Backlash, IsOpenedIfAJogComesBackToTheSoftLimit) {
  config::AxisConfig config = test::homingAxis();
  config.backlash = kBacklash / config.steps_per_unit;
  config.homing->at_max = true;
  config.homing->offset = 0.1;
  config.homing->pull_off = 0.03;
  config.max_position = 0.08;
  bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config});
  const axis::HomingResult homing = x().home([this] { return position() > 0.09; });
  ASSERT_EQ(homing.end, axis::HomingEnd::kCancelled) << homing.message;
  while (x().state().moving) bench->machine->advance(1e-3);
  ASSERT_GT(position(), 0.09);
  x().jog(-0.05);
  bench->machine->advance(0.1);
  x().jog(0.05);
  while (x().state().moving) bench->machine->advance(1e-3);
  EXPECT_DOUBLE_EQ(position(), 0.08);
  EXPECT_EQ(x().state().slack, 0.0);
  expectClean();
}

TEST_F(Backlash, KeepsThePositionOverAMicrostepChange) {
  moveTo(0.010);
  moveTo(0.0098);  // 784, a full step: none of the backlash is taken up
  for (const int mode : {8, 16}) {
    x().setMicrosteps(mode);
    EXPECT_DOUBLE_EQ(position(), 0.0098);
  }
  moveTo(0.010);
  EXPECT_EQ(motor() - 784, 16 + kBacklash);
  EXPECT_REFUSED(x().setMicrosteps(4), "1/4 has no position at 0.01 m");
  expectClean();
}

// The change to full steps takes up half of the backlash, which is half a full step.
TEST_F(Backlash, KeepsItsPartThatIsTakenUpOverMicrostepChanges) {
  config::AxisConfig config = linearAxis("x");
  config.backlash = 16.0 / config.steps_per_unit;
  config.align_on_microstep_change = true;
  for (const std::vector<int>& modes : std::vector<std::vector<int>>{{1, 16}, {1, 2, 1, 8, 16}}) {
    bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config});
    x().setPosition(0.0);
    moveTo(0.001);
    moveTo(8.0 / config.steps_per_unit);
    EXPECT_EQ(motor(), 8);
    x().setMicrosteps(modes.front());
    EXPECT_EQ(motor(), 16) << "8 of 16 are taken up";
    for (const int mode : modes) x().setMicrosteps(mode);
    EXPECT_NEAR(position(), 8.0 / config.steps_per_unit, 1e-12);
    moveTo(0.010);
    EXPECT_EQ(motor(), 816);
    EXPECT_TRUE(x().state().position_valid);
    expectClean();
  }
}

/// A joint behind a backlash, as the motor moves it.
class Joint {
 public:
  explicit Joint(double backlash) : backlash_(backlash) {}
  /// The motor has moved to a place, without a turn.
  void follow(double motor) {
    slack_ = std::clamp(slack_ + motor - motor_, 0.0, backlash_);
    motor_ = motor;
  }
  double place() const { return motor_ - slack_; }

 private:
  const double backlash_;
  double motor_ = 0.0;
  double slack_ = 0.0;
};

// Moves that end at their targets or on the way, and changes between all modes: what is rounded in
// one mode must not be there in another one.
TEST(BacklashInAllModes, LeavesThePositionValidAndWithinHalfAMicrostepOfTheMode) {
  constexpr std::array<int, 6> kModes{1, 2, 4, 8, 16, 32};
  constexpr double kScale = 80'000.0;
  double worst = 0.0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 random(seed);
    config::AxisConfig config = linearAxis("x", "drv8825");
    config.align_on_microstep_change = true;
    const double backlash =
        std::array<double, 7>{16.0, 30.0, 8.0, 7.3, 1.0, 0.4, 21.5}.at(random() % 7) / kScale;
    config.backlash = backlash;
    Bench bench({config});
    axis::Axis& x = bench.axis();
    x.setPosition(0.0);
    Joint joint(1e3 * backlash);  // mm, like the carriage
    std::string done;
    for (int i = 0; i < 40; ++i) {
      const double way = static_cast<double>(static_cast<int>(random() % 121) - 60) / kScale;
      const bool changes = random() % 3 == 0;
      const int mode = kModes.at(random() % kModes.size());
      if (changes) {
        x.setMicrosteps(mode);
        done += " 1/" + std::to_string(mode);
      } else {
        const bool stops = random() % 2 == 0;
        const axis::Move move = x.moveTo(way, true);
        if (stops) {
          bench.machine->advance(1e-4 * static_cast<double>(random() % 80));
          x.stop();
        }
        x.wait(move);
        while (x.state().moving) bench.machine->advance(1e-3);
        done += (stops ? " stopped " : " by ") + std::to_string(way * kScale);
      }
      joint.follow(bench.report().carriage);
      const axis::AxisState state = x.state();
      ASSERT_TRUE(state.position_valid);
      const double off = std::abs(1e3 * state.position - joint.place()) * kScale / 1e3;
      worst = std::max(worst, off * state.microsteps / 16.0);
      ASSERT_LE(off, 0.5 * 16.0 / state.microsteps + 1e-6)
          << "microsteps of 1/16 off in 1/" << state.microsteps << " after" << done
          << ", with a backlash of " << backlash * kScale;
    }
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
  EXPECT_GT(worst, 0.1) << "a test that rounds nothing shows nothing";
}

// Whatever takes over, the joint rests within its soft limits: with the backlash taken up at the
// upper one, or opened if the axis had to come back to it.
// In the other three, a stop comes where a motion is about to turn within a microstep of the limit.
class BacklashAtSoftLimits : public testing::TestWithParam<unsigned> {};
INSTANTIATE_TEST_SUITE_P(Stories, BacklashAtSoftLimits, testing::Values(33U, 1U, 14U, 49U));

TEST_P(BacklashAtSoftLimits, IsNoWayBeyondThem) {
  std::mt19937 random(GetParam());
  const auto any = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int round = 0; round < 60; ++round) {
    config::AxisConfig config = linearAxis("x");
    config.backlash = kBacklash / config.steps_per_unit;
    config.min_position = -0.004;
    config.max_position = 0.004;
    config.jerk = round % 2 == 0 ? 0.0 : 100.0;
    if (round % 3 == 0) config.stop_deceleration = 3.0;
    Bench bench({config});
    axis::Axis& x = bench.axis();
    std::string story;
    for (int i = 0; i < 40; ++i) {
      const int kind = static_cast<int>(any(0.0, 6.0));
      const double value = any(-1.0, 1.0);
      story += fmt::format("{} {}, ", kind, value);
      try {
        if (kind == 0) x.moveTo(0.004 * value);
        if (kind == 1) x.jog(0.1 * value);
        if (kind == 2 || kind == 3) {
          const auto mode =
              kind == 2 ? machine::SetpointMode::kVelocity : machine::SetpointMode::kPosition;
          static_cast<void>(bench.machine->followSetpoints(
              mode, 0.2, {{"x", (kind == 2 ? 0.1 : 0.006) * value, {}}}));
        }
        if (kind == 4) x.stop();
        if (kind == 5) {
          const double part = std::pow(10.0, -1.0 + value);
          x.setLimits({0.0, part, part, config.jerk * part});
        }
      } catch (const Refused&) {
      }
      bench.machine->advance(any(0.0, 0.05));
      if (i % 8 == 7) {
        bench.machine->advance(1.0);
        x.stop();
        while (x.state().moving) bench.machine->advance(0.01);
        x.setLimits({});
      }
      if (x.state().moving) continue;
      EXPECT_LE(std::abs(x.state().position), 0.004 + 1e-9) << story;
    }
  }
}

}  // namespace
}  // namespace stepdriver
