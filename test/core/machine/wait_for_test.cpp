#include <gtest/gtest.h>

#include <chrono>
#include <optional>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"

namespace stepdriver {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using test::Bench;
using test::linearAxis;

TEST(WaitFor, ReturnsAtItsTimeWhileTheMoveContinues) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  const axis::Move move = x.moveTo(0.05);
  const pulse::Nanoseconds began = bench.clock.now();
  EXPECT_FALSE(x.waitFor(move, milliseconds(10)));
  EXPECT_EQ(bench.clock.now() - began, 10'000'000);
  EXPECT_TRUE(x.state().moving);
  const auto result = x.waitFor(move, hours(1));
  ASSERT_TRUE(result);
  EXPECT_EQ(result->end, axis::MoveEnd::kReached);
  EXPECT_LT(bench.clock.now() - began, 3'000'000'000) << "it has waited after the end of the move";
}

TEST(WaitFor, ReturnsAtOnceIfItMayNotWait) {
  Bench bench({linearAxis("x")});
  const axis::Move move = bench.axis().moveTo(0.05);
  const pulse::Nanoseconds began = bench.clock.now();
  EXPECT_FALSE(bench.axis().waitFor(move, milliseconds(0)));
  EXPECT_FALSE(bench.axis().waitFor(move, std::chrono::nanoseconds::min()));
  EXPECT_EQ(bench.clock.now(), began);
  const axis::MoveResult ended = bench.axis().wait(move);
  const auto again = bench.axis().waitFor(move, milliseconds(0));
  ASSERT_TRUE(again) << "the move has ended";
  EXPECT_EQ(again->message, ended.message);
}

TEST(WaitFor, EndsIfNothingIsUnderWayThatCouldEndTheMove) {
  Bench bench({linearAxis("x")});
  const axis::Move move = bench.axis().moveTo(0.05);
  bench.machine->hold();
  EXPECT_FALSE(bench.axis().waitFor(move, milliseconds(2000)));
  EXPECT_THROW(bench.axis().wait(move), Error) << "a wait without a bound would never end";
  EXPECT_THROW(bench.axis().waitFor(move, std::chrono::nanoseconds::max()), Error);
}

TEST(WaitFor, SeesTheFaultOfAChip) {
  config::AxisConfig config = linearAxis("x", "drv8825");
  config.fault = config::FaultPin{"x.fault"};
  Bench bench({config});
  sim::RigFaults faults;
  faults.chip_fault_after = 100;
  bench.rig.setFaults("x", faults);
  bench.may_exceed_limits = true;  // its steps end at once
  const auto result = bench.axis().waitFor(bench.axis().moveTo(0.05), hours(1));
  ASSERT_TRUE(result);
  EXPECT_EQ(result->end, axis::MoveEnd::kFault);
  EXPECT_LT(bench.pulses(), 200);
}

TEST(WaitFor, WaitsForALine) {
  Bench bench({linearAxis("x"), linearAxis("y")});
  const machine::CoordinatedMove line = bench.machine->moveLine({{"x", "y"}, {0.03, 0.02}});
  EXPECT_FALSE(bench.machine->waitFor(line, milliseconds(10)));
  const auto result = bench.machine->waitFor(line, hours(1));
  ASSERT_TRUE(result);
  EXPECT_EQ(result->message, "all axes reached their targets");
}

TEST(WaitFor, OfAMachineWithThreadsIsBoundedByTheSteadyClock) {
  Bench bench({linearAxis("x")}, true);
  axis::Axis& x = bench.axis();
  std::optional<pulse::ClockHold> held(bench.clock);  // it can't end
  const axis::Move move = x.moveTo(0.05);
  const auto began = std::chrono::steady_clock::now();
  EXPECT_FALSE(x.waitFor(move, milliseconds(20)));
  EXPECT_GE(std::chrono::steady_clock::now() - began, milliseconds(20));
  held.reset();
  const auto result = x.waitFor(move, hours(1));
  ASSERT_TRUE(result);
  EXPECT_EQ(result->end, axis::MoveEnd::kReached);
}

TEST(WaitFor, ALineWhoseMachineIsGoneStillHasItsResult) {
  Bench bench({linearAxis("x"), linearAxis("y")});
  const machine::CoordinatedMove line = bench.machine->moveLine({{"x", "y"}, {0.03, 0.02}});
  bench.machine->advance(0.2);
  bench.machine->shutdown();
  const auto told = bench.machine->result(line);
  bench.machine.reset();
  std::vector<axis::MoveResult> members;
  for (const auto& member : line.members) members.push_back(member.move.outcome->get().value());
  const machine::CoordinatedResult result = machine::combinedResult(members);
  EXPECT_EQ(result.end, axis::MoveEnd::kStopped);
  ASSERT_TRUE(told);
  EXPECT_EQ(result.message, told->message);
  EXPECT_EQ(result.positions, told->positions);
}

}  // namespace
}  // namespace stepdriver
