#include <gtest/gtest.h>

#include <cerrno>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "support/bench.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using config::IdleAction;
using test::Bench;
using test::violationsOf;

constexpr double kTimeout = 2.0;

config::AxisConfig idleAxis(IdleAction action = IdleAction::kDisable,
                            const std::string& model = "a4988") {
  config::AxisConfig config = test::linearAxis("x", model);
  config.idle_timeout = kTimeout;
  config.idle_action = action;
  return config;
}

TEST(AxisIdle, TakesTheCurrentAwayAfterTheTimeAtRestToTheNanosecond) {
  for (const IdleAction action : {IdleAction::kDisable, IdleAction::kSleep}) {
    Bench bench({idleAxis(action)});
    axis::Axis& x = bench.axis();
    const axis::MoveResult result = bench.move(0.01);
    const std::int64_t rest = bench.clock.now();
    ASSERT_EQ(result.end, axis::MoveEnd::kReached);
    bench.machine->advance(1.9);
    EXPECT_FALSE(x.state().idle);
    EXPECT_TRUE(bench.report().energized);
    bench.machine->advance(5.0);
    EXPECT_TRUE(x.state().idle);
    EXPECT_FALSE(bench.report().energized);
    EXPECT_EQ(x.state().enabled, action == IdleAction::kSleep);
    EXPECT_EQ(x.state().asleep, action == IdleAction::kSleep);
    const bool sleeps = action == IdleAction::kSleep;
    const auto edges = bench.trace->times("x", sleeps ? "sleep" : "enable", !sleeps);
    ASSERT_FALSE(edges.empty());
    EXPECT_EQ(edges.back(), rest + 2'000'000'000);
  }
}

TEST(AxisIdle, StaysAwakeThroughALongMotionAndCountsFromItsEnd) {
  Bench bench({idleAxis()});
  axis::Axis& x = bench.axis();
  x.moveTo(0.09, false, 0.01);  // 9 s
  bench.machine->advance(8.0);
  EXPECT_FALSE(x.state().idle);
  EXPECT_TRUE(bench.report().energized);
  x.stop();
  bench.machine->advance(1.9);
  EXPECT_FALSE(x.state().idle);
  bench.machine->advance(0.2);
  EXPECT_TRUE(x.state().idle);
}

TEST(AxisIdle, WakesForTheNextMotionWithTheChipsTimes) {
  for (const std::string model : {"a4988", "drv8825", "tb6600"}) {
    for (const IdleAction action : {IdleAction::kDisable, IdleAction::kSleep}) {
      if (action == IdleAction::kSleep && model == "tb6600") continue;
      config::AxisConfig config = idleAxis(action, model);
      config.start_speed = config.max_speed;  // the first step comes at once
      Bench bench({config});
      axis::Axis& x = bench.axis();
      for (int round = 1; round <= 3; ++round) {
        bench.machine->advance(3.0);
        EXPECT_TRUE(x.state().idle);
        if (round == 2) {
          x.jog(0.01);
          bench.machine->advance(0.5);
          x.stop();
          bench.machine->advance(0.1);
        } else {
          EXPECT_EQ(x.wait(x.moveTo(0.001, true)).end, axis::MoveEnd::kReached);
        }
        EXPECT_FALSE(x.state().idle);
        EXPECT_TRUE(bench.report().energized);
      }
      EXPECT_EQ(violationsOf(bench.report()), "");
    }
  }
}

TEST(AxisIdle, LeavesAnAxisThatWasDisabledOrPutToSleepAsItIs) {
  for (const IdleAction action : {IdleAction::kDisable, IdleAction::kSleep}) {
    for (const bool idle_before : {false, true}) {
      Bench bench({idleAxis(action)});
      axis::Axis& x = bench.axis();
      if (idle_before) bench.machine->advance(3.0);
      x.enable(false);
      bench.machine->advance(10.0);
      EXPECT_FALSE(x.state().idle);
      EXPECT_FALSE(x.state().asleep);
      EXPECT_REFUSED(x.moveTo(0.001), "disabled");
      x.enable(true);
      EXPECT_TRUE(bench.report().energized);

      if (idle_before) bench.machine->advance(3.0);
      x.sleep(true);
      bench.machine->advance(10.0);
      EXPECT_FALSE(x.state().idle);
      EXPECT_TRUE(x.state().enabled);
      EXPECT_REFUSED(x.moveTo(0.001), "asleep");
      x.sleep(false);
      EXPECT_TRUE(bench.report().energized);
      EXPECT_EQ(bench.move(0.001).end, axis::MoveEnd::kReached);
      EXPECT_EQ(violationsOf(bench.report()), "");
    }
  }
}

TEST(AxisIdle, IsEndedByAnEnableOrAWake) {
  Bench disabled({idleAxis(IdleAction::kDisable)});
  disabled.machine->advance(3.0);
  disabled.axis().enable(true);
  EXPECT_FALSE(disabled.axis().state().idle);
  EXPECT_TRUE(disabled.report().energized);
  disabled.machine->advance(1.9);
  EXPECT_TRUE(disabled.report().energized) << "it counts anew";
  disabled.machine->advance(0.2);
  EXPECT_FALSE(disabled.report().energized);

  Bench asleep({idleAxis(IdleAction::kSleep)});
  asleep.machine->advance(3.0);
  asleep.axis().sleep(false);
  EXPECT_FALSE(asleep.axis().state().idle);
  EXPECT_TRUE(asleep.report().energized);
}

TEST(AxisIdle, KeepsTheCurrentAtAFault) {
  Bench bench({idleAxis()});
  bench.machine->emergencyStop();
  bench.machine->advance(10.0);
  EXPECT_TRUE(bench.report().energized);
  EXPECT_FALSE(bench.axis().state().idle);
  bench.machine->recover();
  bench.machine->advance(0.1);
  EXPECT_TRUE(bench.axis().state().idle) << "it has stood for long";
}

TEST(AxisIdle, StaysThroughAnEmergencyStopAndItsEnd) {
  for (const IdleAction action : {IdleAction::kDisable, IdleAction::kSleep}) {
    Bench bench({idleAxis(action)});
    bench.machine->advance(3.0);
    bench.machine->emergencyStop();
    bench.machine->recover();
    EXPECT_TRUE(bench.axis().state().idle);
    EXPECT_FALSE(bench.report().energized);
    EXPECT_EQ(bench.move(0.001).end, axis::MoveEnd::kReached);
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
}

TEST(AxisIdle, AFailedWriteIsAFaultOfTheAxis) {
  config::AxisConfig config = idleAxis();
  Bench bench({config});
  bench.rig.failWrites("x.enable", 0, EIO);
  bench.machine->advance(3.0);
  EXPECT_FALSE(bench.axis().state().idle);
  EXPECT_NE(bench.axis().state().fault.find("ENABLE line x.enable can't be written"),
            std::string::npos)
      << bench.axis().state().fault;
  bench.rig.clearWriteFault("x.enable");
  bench.machine->recover();
  EXPECT_EQ(bench.move(0.001).end, axis::MoveEnd::kReached);
}

TEST(AxisIdle, StaysThroughAWakeUpThatFails) {
  for (const IdleAction action : {IdleAction::kDisable, IdleAction::kSleep}) {
    const std::string line = action == IdleAction::kSleep ? "x.sleep" : "x.enable";
    Bench bench({idleAxis(action)});
    bench.machine->advance(3.0);
    bench.rig.failWrites(line, 0, EIO);
    EXPECT_THROW(bench.axis().moveTo(0.001), GpioError);
    EXPECT_EQ(bench.pulses(), 0);
    bench.rig.clearWriteFault(line);
    bench.machine->recover();
    EXPECT_TRUE(bench.axis().state().idle);
    EXPECT_FALSE(bench.report().energized);
    EXPECT_EQ(bench.move(0.001).end, axis::MoveEnd::kReached);
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
}

// The position stays valid only if the mechanics hold it. If the translator goes Home, the position
// must also be one of that phase: 64 microsteps at 1/16, 0.8 mm.
TEST(AxisIdle, KeepsTheTrustOnlyWhereNothingCanHaveMoved) {
  struct Case {
    IdleAction action;
    bool holds;
    double position;  ///< [m]
    bool trusted;
  };
  const std::vector<Case> cases = {{IdleAction::kDisable, false, 0.0008, false},
                                   {IdleAction::kDisable, true, 0.0009, true},
                                   {IdleAction::kSleep, false, 0.0008, false},
                                   {IdleAction::kSleep, true, 0.0009, false},
                                   {IdleAction::kSleep, true, -0.0008, true}};
  for (const Case& each : cases) {
    for (const bool by_hand : {false, true}) {
      config::AxisConfig config = idleAxis(each.action);
      config.holds_position_unpowered = each.holds;
      Bench bench({config});
      axis::Axis& x = bench.axis();
      x.setPosition(0.0);
      bench.move(each.position);
      if (!by_hand) {
        bench.machine->advance(3.0);
      } else if (each.action == IdleAction::kSleep) {
        x.sleep(true);
        x.sleep(false);
      } else {
        x.enable(false);
        x.enable(true);
      }
      EXPECT_EQ(x.state().position_valid, each.trusted)
          << "by hand " << by_hand << " holds " << each.holds << " at " << each.position;
      bench.move(each.position + 0.001);
      if (each.trusted) {
        EXPECT_NEAR(bench.report().carriage, 1e3 * x.state().position, 1e-9);
      }
      EXPECT_EQ(violationsOf(bench.report()), "");
    }
  }
}

TEST(AxisIdle, IsServedByTheWatcherOfAThreadedMachineWithoutInputs) {
  config::AxisConfig config = idleAxis();
  config.idle_timeout = 0.01;
  config.endstop_min.reset();
  config.endstop_max.reset();
  Bench bench({config}, true, 1.0);
  while (!bench.axis().state().idle) std::this_thread::yield();
  EXPECT_FALSE(bench.report().energized);
  EXPECT_EQ(bench.move(0.001).end, axis::MoveEnd::kReached);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

}  // namespace
}  // namespace stepdriver
