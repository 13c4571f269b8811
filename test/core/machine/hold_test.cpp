#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/refusal.h"
#include "support/within.h"

// A hold is a state of the machine. Whether axes move or not, it lasts until a resume or a stop of
// the machine.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::linearAxis;
using test::violationsOf;
using test::within;

class Hold : public testing::Test {
 protected:
  void SetUp() override {
    bench = std::make_unique<Bench>(
        std::vector<config::AxisConfig>{linearAxis("x"), linearAxis("y"), linearAxis("z")});
    for (const auto& axis : machine().axes()) axis->setPosition(0.0);
  }
  void TearDown() override {
    for (const char* name : {"x", "y", "z"}) EXPECT_EQ(violationsOf(bench->report(name)), "");
  }

  test::UnthreadedMachine& machine() { return *bench->machine; }
  axis::Axis& axis(const std::string& name) { return bench->axis(name); }

  void expectHeld() {
    for (const char* name : {"x", "y", "z"}) {
      EXPECT_TRUE(axis(name).state().held) << name;
      EXPECT_REFUSED(axis(name).moveTo(0.01), "the machine is on hold; resume or stop it first");
      EXPECT_REFUSED(axis(name).jog(0.01), "the machine is on hold; resume or stop it first");
    }
    EXPECT_REFUSED(machine().moveLine({{"x", "y"}, {0.01, 0.01}}),
                   "the machine is on hold; resume or stop it first");
    EXPECT_REFUSED(machine().followTrajectory({{"x"}, {{1.0, {0.01}, {}, {}}}}),
                   "the machine is on hold; resume or stop it first");
  }
  void expectFree() {
    for (const char* name : {"x", "y", "z"}) {
      EXPECT_FALSE(axis(name).state().held) << name;
      EXPECT_EQ(bench->move(0.01, name).end, MoveEnd::kReached);
      EXPECT_EQ(bench->pulses(name), 800);
    }
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(Hold, OfAMachineAtRestLastsUntilAResumeOrAStop) {
  for (const bool resume : {true, false}) {
    SetUp();
    machine().hold();
    machine().advance(1.0);
    expectHeld();
    EXPECT_EQ(bench->pulses("x"), 0);
    resume ? machine().resume() : machine().stop();
    expectFree();
  }
}

TEST_F(Hold, OfOneMovingAxisHoldsAllAndKeepsTheGoal) {
  const axis::Move move = axis("x").moveTo(0.05);
  machine().advance(0.3);
  machine().hold();
  machine().advance(1.0);
  expectHeld();
  EXPECT_FALSE(axis("x").result(move).has_value());
  machine().resume();
  EXPECT_EQ(axis("x").wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 4000);
  expectFree();
}

// A move with a low jerk that takes over while the axis decelerates at the configured one turns
// first. Whenever a stop or a hold comes, it brings the axis to rest in the time that it needs.
TEST_F(Hold, AndStopEndAMoveThatIsAboutToTurn) {
  for (const bool hold : {true, false}) {
    for (int i = 2; i < 60; ++i) {
      const int after = i / 2;
      const double target = i % 2 == 0 ? 0.1 : 0.0;
      SCOPED_TRACE(testing::Message() << "to " << target << " m, after " << after);
      config::AxisConfig config = linearAxis("x", 20'000.0, 0.06, 0.3);
      config.jerk = 3.0;
      Bench one({config});
      axis::Axis& x = one.axis("x");
      x.setPosition(0.0);
      x.setLimits({0.0, 0.0, 0.0, 0.3});
      x.jog(0.04);
      one.machine->advance(0.5);
      x.stop();
      one.machine->advance(0.01 * after);
      const axis::Move move = x.moveTo(target);
      one.machine->advance(0.007);
      hold ? one.machine->hold() : x.stop();
      one.machine->advance(0.45);  // 0.06/0.3 s, and 2.5 times 0.3/3 s
      EXPECT_FALSE(x.state().moving);
      EXPECT_EQ(x.result(move).has_value(), !hold);
      EXPECT_EQ(violationsOf(one.report("x")), "");
    }
  }
}

// The shortest stop from 60 mm/s, at 300 mm/s^2, ends less than half a microstep beyond the target.
TEST_F(Hold, AndStopOfAnAxisThatPassesItsTargetMakeNoStepBeyondIt) {
  int passes = 0;
  for (const bool hold : {true, false}) {
    for (int after = 0; after < 20; ++after) {
      SCOPED_TRACE(after);
      Bench one({linearAxis("x", 20'000.0, 0.06, 0.3)});
      axis::Axis& x = one.axis("x");
      x.setPosition(0.0);
      x.jog(0.06);
      one.machine->advance(0.50015 + 0.00001 * after);
      const std::int64_t target =
          std::llround(20'000.0 * (x.state().planned + 0.06 * 0.001 + 0.006) - 0.3);
      const axis::Move move = x.moveTo(static_cast<double>(target) / 20'000.0);
      EXPECT_EQ(move.overshoot, 0.0);
      one.machine->advance(0.19 + 0.001 * after);
      passes += x.state().planned > move.target ? 1 : 0;
      hold ? one.machine->hold() : x.stop();
      one.machine->advance(0.3);
      EXPECT_FALSE(x.state().moving);
      EXPECT_LE(one.pulses("x"), target);
      EXPECT_EQ(violationsOf(one.report("x")), "");
    }
  }
  EXPECT_GT(passes, 10);
}

TEST_F(Hold, OutlastsWhatDropsTheGoalThatItKeeps) {
  const std::vector<std::function<void()>> drops = {
      [this] { axis("x").stop(); },
      [this] {
        axis("x").enable(false);
        axis("x").enable(true);
      },
      [this] {
        machine().emergencyStop();
        machine().recover();
      },
  };
  for (std::size_t i = 0; i < drops.size(); ++i) {
    SCOPED_TRACE(i);
    SetUp();
    const axis::Move move = axis("x").moveTo(0.05);
    machine().advance(0.3);
    machine().hold();
    machine().advance(1.0);
    drops[i]();
    ASSERT_TRUE(axis("x").result(move).has_value());
    EXPECT_NE(axis("x").result(move)->end, MoveEnd::kReached);
    expectHeld();
    const std::int64_t pulses = bench->pulses("x");
    machine().resume();
    machine().advance(1.0);
    EXPECT_EQ(bench->pulses("x"), pulses) << "there is no goal any more";
    EXPECT_FALSE(axis("x").state().held);
    EXPECT_EQ(axis("x").wait(axis("x").moveTo(0.001, true)).end, MoveEnd::kReached);
  }
}

TEST_F(Hold, OfAJogEndsItAndLasts) {
  axis("y").jog(0.05);
  machine().advance(0.3);
  machine().hold();
  machine().advance(1.0);
  expectHeld();
  const std::int64_t pulses = bench->pulses("y");
  machine().resume();
  machine().advance(1.0);
  EXPECT_EQ(bench->pulses("y"), pulses);
}

TEST_F(Hold, OfOneAxisAmongOthersDropsOnlyTheGoalThatIsStopped) {
  const axis::Move x = axis("x").moveTo(0.05);
  const axis::Move y = axis("y").moveTo(0.05);
  machine().advance(0.3);
  machine().hold();
  machine().advance(1.0);
  axis("x").stop();
  ASSERT_TRUE(axis("x").result(x).has_value());
  EXPECT_EQ(axis("x").result(x)->end, MoveEnd::kStopped);
  EXPECT_FALSE(axis("y").result(y).has_value());
  expectHeld();
  machine().resume();
  EXPECT_EQ(axis("y").wait(y).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("y"), 4000);
  EXPECT_LT(bench->pulses("x"), 4000);
}

// x needs 2 s to stop: the hold comes long before that.
TEST(HoldOfAWaitingLine, LetsItBeginAfterTheResume) {
  config::AxisConfig slow = linearAxis("x");
  slow.deceleration = 0.005;
  Bench bench({slow, linearAxis("y")}, true, 1.0);
  for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
  axis::Axis& x = bench.axis("x");
  const axis::Move move = x.moveTo(0.08, false, 0.01);  // 10 s
  ASSERT_TRUE(within([&] { return bench.pulses("x") > 20; }));
  auto line = std::async(std::launch::async, [&] {
    return bench.machine->wait(bench.machine->moveLine({{"x", "y"}, {0.001, 0.002}, true}));
  });
  EXPECT_TRUE(within([&] { return x.state().target < 0.079; }));
  bench.machine->hold();
  EXPECT_EQ(x.wait(move).end, MoveEnd::kStopped);
  EXPECT_TRUE(bench.axis("y").state().held);
  EXPECT_EQ(bench.pulses("y"), 0);
  bench.machine->resume();
  EXPECT_EQ(line.get().end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 6480) << "0.081 m";
  EXPECT_EQ(bench.pulses("y"), 160);
}

TEST_F(Hold, RefusesWhatMovesNothingOnlyToAnAxisThatKeepsAGoal) {
  axis("y").moveTo(0.05);
  machine().advance(0.3);
  machine().hold();
  machine().advance(1.0);
  EXPECT_REFUSED(axis("y").setPosition(0.0), "the machine is on hold; resume or stop it first");
  EXPECT_REFUSED(axis("y").sleep(true), "the machine is on hold; resume or stop it first");
  axis("x").setPosition(0.002);
  axis("x").sleep(true);
  axis("x").sleep(false);
  axis("x").enable(false);
  axis("x").enable(true);
  machine().setSpeedOverride(0.5);
  axis("x").setLimits({0.05, 0.0, 0.0, 0.0});
  expectHeld();
  EXPECT_EQ(bench->pulses("x"), 0);
}

}  // namespace
}  // namespace stepdriver
