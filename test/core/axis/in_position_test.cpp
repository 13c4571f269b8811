#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "support/bench.h"
#include "support/homing_bench.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::linearAxis;
using test::violationsOf;

/// The driver is in position 300 ms after the last step, and at the latest 800 ms after it. A move
/// to 10 mm takes 200 ms.
class InPositionOfAnAxis : public testing::Test {
 protected:
  static config::AxisConfig with(config::AxisConfig config) {
    config.driver.title = "box";
    config.driver.in_position_active = false;
    config.driver.in_position_name = "PEND";
    config.in_position = config::InPositionPin{config.name + ".pend", Bias::kPullUp, 0.8};
    return config;
  }

  void build(const std::vector<config::AxisConfig>& configs) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(configs);
    for (sim::RigAxisSpec& spec : specs) spec.settling_ns = 300'000'000;
    bench_ = std::make_unique<Bench>(configs, specs);
    bench_->machine->advance(1.0);
    began_ = bench_->clock.now();
  }
  void SetUp() override { build({with(linearAxis("x"))}); }

  axis::Axis& x() { return bench_->axis(); }
  double elapsed() const { return static_cast<double>(bench_->clock.now() - began_) * 1e-9; }

  void neverInPosition(const std::string& name = "x") {
    sim::RigFaults faults;
    faults.never_in_position = true;
    bench_->rig.setFaults(name, faults);
  }

  /// A move that has made its last step and waits.
  axis::Move waitingMove() {
    x().setPosition(0.0);
    axis::Move move = x().moveTo(0.01);
    bench_->machine->advance(0.3);
    EXPECT_EQ(bench_->pulses(), 800);
    EXPECT_TRUE(x().state().moving);
    return move;
  }

  std::unique_ptr<Bench> bench_;
  pulse::Nanoseconds began_ = 0;
};

TEST_F(InPositionOfAnAxis, ComesBeforeAMoveIsFinished) {
  const axis::MoveResult result = bench_->move(0.01);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_NEAR(elapsed(), 0.5, 0.01);
  EXPECT_NEAR(result.duration, 0.5, 0.01) << "the wait is a part of the move";
  EXPECT_FALSE(x().state().moving);
}

TEST_F(InPositionOfAnAxis, ThatIsMissingIsAFaultThatSaysHowLongItWaited) {
  x().setPosition(0.0);
  neverInPosition();
  const axis::MoveResult result = bench_->move(0.01);
  EXPECT_EQ(result.end, MoveEnd::kFault);
  const std::string why =
      "the box isn't in position: PEND was still inactive 800 ms after the end of the motion";
  EXPECT_NE(result.message.find(why), std::string::npos) << result.message;
  EXPECT_NEAR(elapsed(), 1.0, 0.01);
  EXPECT_FALSE(x().state().position_valid);
  EXPECT_DOUBLE_EQ(x().state().position, 0.01) << "the count of the steps";
  EXPECT_REFUSED(x().moveTo(0.0), why);
  bench_->rig.setFaults("x", {});
  bench_->machine->recover();
  EXPECT_EQ(bench_->move(0.0).end, MoveEnd::kReached);
}

TEST_F(InPositionOfAnAxis, DoesNotKeepAStopWaitingAndNothingWasReached) {
  const axis::Move move = waitingMove();
  x().stop();
  const axis::MoveResult result = x().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kStopped) << result.message;
  EXPECT_LT(elapsed(), 0.32);
  EXPECT_TRUE(x().state().position_valid);
  EXPECT_EQ(bench_->pulses(), 800);
  EXPECT_EQ(bench_->move(0.0).end, MoveEnd::kReached);
}

TEST_F(InPositionOfAnAxis, DoesNotKeepADisableWaiting) {
  neverInPosition();
  const axis::Move move = waitingMove();
  x().enable(false);
  EXPECT_LT(elapsed(), 0.32);
  EXPECT_FALSE(bench_->report().energized);
  EXPECT_EQ(x().wait(move).end, MoveEnd::kStopped);
  EXPECT_EQ(x().state().fault, "");
}

TEST_F(InPositionOfAnAxis, DoesNotKeepAnEmergencyStopWaiting) {
  const axis::Move move = waitingMove();
  bench_->machine->emergencyStop();
  EXPECT_LT(elapsed(), 0.32);
  EXPECT_EQ(x().wait(move).end, MoveEnd::kEmergencyStop);
  EXPECT_EQ(x().state().fault, "emergency stop");
}

TEST_F(InPositionOfAnAxis, DoesNotKeepAShutdownWaiting) {
  neverInPosition();
  const axis::Move move = waitingMove();
  bench_->machine->shutdown();
  EXPECT_LT(elapsed(), 0.32);
  EXPECT_EQ(x().wait(move).end, MoveEnd::kStopped);
}

TEST_F(InPositionOfAnAxis, IsAwaitedAfterTheMoveThatTookOver) {
  const axis::Move first = waitingMove();
  const axis::MoveResult second = bench_->move(0.02);
  EXPECT_EQ(x().wait(first).end, MoveEnd::kReplaced);
  EXPECT_EQ(second.end, MoveEnd::kReached);
  EXPECT_NEAR(elapsed(), 0.8, 0.01) << "0.3 s, then 0.2 s, and once the time to settle";
  EXPECT_EQ(bench_->pulses(), 1600);
  EXPECT_EQ(violationsOf(bench_->report()), "");
}

TEST_F(InPositionOfAnAxis, IsTheEndOfRelativeMovesToo) {
  waitingMove();
  const axis::MoveResult second = x().wait(x().moveTo(0.005, true));
  EXPECT_EQ(second.end, MoveEnd::kReached) << second.message;
  EXPECT_EQ(bench_->pulses(), 1200);
}

TEST_F(InPositionOfAnAxis, IsAwaitedAgainAfterAHold) {
  const axis::Move move = waitingMove();
  bench_->machine->hold();
  bench_->machine->advance(2.0);
  EXPECT_EQ(x().state().fault, "") << "a hold doesn't wait for it";
  bench_->machine->resume();
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench_->pulses(), 800);
}

TEST_F(InPositionOfAnAxis, IsNotAwaitedLongerIfTheSpeedOverrideChanges) {
  neverInPosition();
  const axis::Move move = waitingMove();
  for (int i = 0; i < 30; ++i) {
    bench_->machine->setSpeedOverride(i % 2 == 0 ? 0.5 : 1.0);
    bench_->machine->advance(0.02);
  }
  EXPECT_EQ(x().wait(move).end, MoveEnd::kFault);
  EXPECT_LT(elapsed(), 1.02);
}

TEST_F(InPositionOfAnAxis, OfEachAxisEndsALine) {
  build({with(linearAxis("x")), with(linearAxis("y"))});
  neverInPosition("y");
  motion::LineRequest line;
  line.names = {"x", "y"};
  line.positions = {0.01, 0.01};
  const auto result = bench_->machine->wait(bench_->machine->moveLine(line));
  EXPECT_EQ(result.end, MoveEnd::kFault);
  EXPECT_NE(result.message.find("y stands at"), std::string::npos) << result.message;
  EXPECT_EQ(x().state().fault, "") << "x was in position before that";
  EXPECT_NE(bench_->axis("y").state().fault, "");
}

TEST_F(InPositionOfAnAxis, IsTheEndOfAHoming) {
  for (const bool comes : {true, false}) {
    build({with(test::homingAxis())});
    if (!comes) neverInPosition();
    const axis::HomingResult result = x().home();
    EXPECT_EQ(result.end, comes ? axis::HomingEnd::kHomed : axis::HomingEnd::kFailed);
    EXPECT_EQ(x().state().homed, comes);
    EXPECT_EQ(x().state().position_valid, comes);
    const bool says_so = result.message.find("isn't in position") != std::string::npos;
    EXPECT_NE(says_so, comes) << result.message;
  }
}

}  // namespace
}  // namespace stepdriver
