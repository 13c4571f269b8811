#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Endstops.h>
#include <stepdriver/Microstep.h>
#include <stepdriver/MoveRounds.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/SetPosition.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <future>
#include <string>

#include "hardware/line_record.h"
#include "hardware/needs_gpio_sim.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "support/ask_node.h"
#include "support/call_service.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

// The shipped launch file with the shipped configuration, on a chip with the line names of a
// Raspberry Pi. The tests build on one another, like a user's first hour.

namespace stepdriver::node_test {
namespace {

const std::string kNode = "/pi/stepdriver";
constexpr double kStepsPerMetre = 80000.0;
// [m/s] A virtual machine with one CPU can sustain its 160 steps/s, with time left for the node.
constexpr double kVelocity = 0.002;

// The lines that config/a4988.yaml names, by their offsets.
constexpr unsigned kStep = 17;
constexpr unsigned kDir = 27;
constexpr unsigned kEnable = 22;
constexpr std::array<unsigned, 3> kMode{5, 6, 13};
constexpr unsigned kSleep = 19;
constexpr unsigned kReset = 26;
constexpr unsigned kMax = 24;

class LaunchedNode : public NeedsGpioSim {
 protected:
  void SetUp() override {
    NeedsGpioSim::SetUp();
    if (IsSkipped()) return;
    header = test::GpioSimLines("header");
    lines = {number(kStep), number(kDir)};
  }

  unsigned number(unsigned offset) const { return numberOf(header, offset); }

  static std_srvs::SetBool::Response set(const std::string& service, bool on) {
    std_srvs::SetBool::Request request;
    request.data = on;
    return callWhenThere<std_srvs::SetBool>(kNode + "/" + service, request);
  }

  static std_srvs::Trigger::Response trigger(const std::string& service) {
    return callWhenThere<std_srvs::Trigger>(kNode + "/" + service);
  }

  static MoveTo::Response moveTo(double position) {
    MoveTo::Request request;
    request.position = position;
    request.velocity = kVelocity;
    request.wait = true;
    return callWhenThere<MoveTo>(kNode + "/x/move_to", request);
  }

  /// A client that waits for a move, which is under way when this returns.
  std::future<MoveTo::Response> movingTo(double position) const {
    EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.moving.at(0) == 0; }));
    const double begin = states.messages().back().position.at(0);
    auto answer = std::async(std::launch::async, [position] { return moveTo(position); });
    EXPECT_TRUE(states.waitForLatest([begin](const AxisStates& s) {
      return s.moving.at(0) != 0 && std::abs(s.position.at(0) - begin) > 0.001;
    })) << "it doesn't move";
    return answer;
  }

  /// The kernel's record agrees with the node's answers.
  void expectPulses(double position) const {
    EXPECT_EQ(pulsesIn(LineRecord::sinceBoot(), lines), std::llround(position * kStepsPerMetre));
  }

  test::GpioSimLines header;
  StepAndDir lines{};
  const Recorder<AxisStates> states{kNode + "/axis_states"};
};

TEST_F(LaunchedNode, HoldsTheMotorOffUntilEnable) {
  ASSERT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.enabled.at(0) == 0; }));
  EXPECT_FALSE(header.level(kStep));
  EXPECT_TRUE(header.level(kEnable)) << "ENABLE is active low: high is disabled";
  EXPECT_TRUE(header.level(kSleep)) << "awake";
  EXPECT_TRUE(header.level(kReset)) << "not held";
  for (const unsigned mode : kMode) EXPECT_TRUE(header.level(mode)) << "1/16 is HHH";
  const auto refused = moveTo(0.01);
  EXPECT_FALSE(refused.success);
  expectSays(refused.message, "disabled");
  const auto trace = LineRecord::sinceBoot();
  EXPECT_TRUE(timesSet(trace, number(kEnable), false).empty()) << "it was on for a moment";
  EXPECT_TRUE(timesSet(trace, number(kStep), true).empty());

  EXPECT_TRUE(set("x/enable", true).success);
  EXPECT_FALSE(header.level(kEnable));
}

TEST_F(LaunchedNode, MovesByAsManyPulsesAsItSays) {
  const auto there = moveTo(0.01);
  EXPECT_TRUE(there.success) << there.message;
  expectPulses(0.01);
  MoveRounds::Request back;
  back.rounds = -0.1;
  back.velocity = kVelocity;
  back.wait = true;
  const auto answer = callWhenThere<MoveRounds>(kNode + "/x/move_rounds", back);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_NEAR(answer.position, 0.006, 1e-9);
  expectPulses(0.006);
  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& s) { return std::abs(s.position.at(0) - 0.006) < 1e-9; }));
}

TEST_F(LaunchedNode, SetsThePinsOfTheChipAsItsServicesSay) {
  const auto expect_mode = [this](int microsteps, std::array<bool, 3> code) {
    Microstep::Request request;
    request.microsteps = microsteps;
    const auto answer = callWhenThere<Microstep>(kNode + "/x/microstep", request);
    EXPECT_TRUE(answer.success) << answer.message;
    for (const std::size_t i : {0U, 1U, 2U}) {
      EXPECT_EQ(header.level(kMode[i]), code[i]) << "MS" << i + 1 << " at " << microsteps;
    }
  };
  expect_mode(8, {true, true, false});
  expect_mode(16, {true, true, true});

  EXPECT_TRUE(set("x/sleep", true).success);
  EXPECT_FALSE(header.level(kSleep));
  EXPECT_TRUE(set("x/sleep", false).success);
  EXPECT_TRUE(header.level(kSleep));

  const auto resets = [this] {
    return LineRecord::sinceBoot().times(number(kReset), false).size();
  };
  const std::size_t before = resets();
  EXPECT_TRUE(trigger("x/reset").success);
  EXPECT_TRUE(header.level(kReset));
  EXPECT_EQ(resets(), before + 1);

  EXPECT_TRUE(
      states.waitForLatest([](const AxisStates& s) { return s.position_valid.at(0) == 0; }));
  SetPosition::Request here;
  here.position = 0.006;
  EXPECT_TRUE(callWhenThere<SetPosition>(kNode + "/x/set_position", here).success);
  EXPECT_TRUE(
      states.waitForLatest([](const AxisStates& s) { return s.position_valid.at(0) != 0; }));
}

TEST_F(LaunchedNode, SendsNoStepAfterItReadAnEndstopThatIsPressedInMidMove) {
  const Recorder<Endstops> endstops(kNode + "/endstops");
  auto waiting = movingTo(0.2);
  header.drive(kMax, true);
  const auto answer = waiting.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "max endstop");
  EXPECT_LT(answer.position, 0.2);
  expectPulses(answer.position);
  EXPECT_TRUE(endstops.waitForLatest([](const Endstops& e) { return e.max.at(0) != 0; }));

  const auto trace = LineRecord::sinceBoot();
  const auto pressed = trace.times(number(kMax), true);
  ASSERT_FALSE(pressed.empty()) << "it never read it";
  EXPECT_LT(trace.times(lines.step, true).back(), pressed.front());

  const auto towards = moveTo(0.2);
  EXPECT_FALSE(towards.success);
  expectSays(towards.message, "max endstop");
  const auto away = moveTo(answer.position - 0.001);
  EXPECT_TRUE(away.success) << away.message;
  expectPulses(answer.position - 0.001);
  header.drive(kMax, false);
  EXPECT_TRUE(endstops.waitForLatest([](const Endstops& e) { return e.max.at(0) == 0; }));
}

TEST_F(LaunchedNode, StopsInAnEmergencyWithTheMotorOnUntilRecover) {
  auto waiting = movingTo(0.2);
  EXPECT_TRUE(trigger("emergency_stop").success);
  const auto pulses = pulsesIn(LineRecord::sinceBoot(), lines);
  const auto answer = waiting.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "emergency stop");
  EXPECT_EQ(pulses, std::llround(answer.position * kStepsPerMetre));
  EXPECT_FALSE(header.level(kStep));
  EXPECT_FALSE(header.level(kEnable)) << "it holds what it carries";

  const auto refused = moveTo(0.0);
  EXPECT_FALSE(refused.success);
  expectSays(refused.message, "recover");
  EXPECT_TRUE(trigger("recover").success);
  expectPulses(answer.position);
  EXPECT_TRUE(moveTo(answer.position - 0.002).success);
  expectPulses(answer.position - 0.002);
}

TEST_F(LaunchedNode, EndsOnSigtermInMidMoveWithItsLinesSafe) {
  const pid_t process = static_cast<int>(askNode(kNode, "getPid"));
  ASSERT_GT(process, 0);
  auto waiting = movingTo(0.2);
  ASSERT_EQ(kill(process, SIGTERM), 0);
  const auto answer = waiting.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "shut down");
  ASSERT_TRUE(waitUntil([process] { return kill(process, 0) != 0 && errno == ESRCH; }));

  expectPulses(answer.position);
  const auto trace = LineRecord::sinceBoot();
  EXPECT_FALSE(lastSet(trace, number(kStep)));
  EXPECT_TRUE(lastSet(trace, number(kEnable))) << "high: disabled";
  EXPECT_FALSE(lastSet(trace, number(kSleep))) << "low: asleep";
  EXPECT_FALSE(lastSet(trace, number(kReset))) << "low: held";
  EXPECT_GT(trace.times(number(kEnable), true).back(), trace.times(lines.step, false).back());
  if (gpio::libgpiodVersion()[0] == '1') {
    EXPECT_EQ(changesTogether(trace, lines.step, lines.dir), 0);
  }
}

}  // namespace
}  // namespace stepdriver::node_test
