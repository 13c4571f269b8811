#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/refusal.h"

// Requests that come while a line waits for its axes, which are stopping or taking up their
// backlash. The virtual clock is held meanwhile, so this state lasts as long as the test needs it.
// The rig counts the steps. x, y and z have 40 steps/mm.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::linearAxis;
using test::violationsOf;

constexpr std::chrono::seconds kLongestAnswer{60};
constexpr double kBacklashOfY = 0.008;  // m
constexpr std::int64_t kBacklashSteps = 320;

/// @return whether the condition was met within the bound.
bool await(const std::function<bool()>& met) {
  const auto end = std::chrono::steady_clock::now() + kLongestAnswer;
  while (!met()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(100));
  }
  return true;
}

bool isAccepted(const std::function<void()>& action) {
  try {
    action();
  } catch (const Refused&) {
    return false;
  }
  return true;
}

class StopPromises : public testing::Test {
 protected:
  void build(double clock_speed, double backlash) {
    std::vector<config::AxisConfig> axes;
    for (const char* name : {"x", "y", "z"}) axes.push_back(linearAxis(name, 40'000.0, 0.1, 1.0));
    axes[1].backlash = backlash;
    bench = std::make_unique<Bench>(axes, true, clock_speed);
    for (const char* name : {"x", "y", "z"}) bench->axis(name).setPosition(0.0);
  }

  void TearDown() override {
    for (const char* name : {"x", "y", "z"}) EXPECT_EQ(violationsOf(bench->report(name)), "");
  }

  axis::Axis& axis(const std::string& name) { return bench->axis(name); }
  test::UnthreadedMachine& machine() { return *bench->machine; }

  /// Requests a line of x and y in another thread, which waits for its end if it is accepted.
  void askForLine(bool wait = true) {
    line_ = std::async(std::launch::async, [this, wait] {
      try {
        const machine::CoordinatedMove move = machine().moveLine({{"x", "y"}, {0.05, 0.05}});
        return "accepted: " + (wait ? machine().wait(move).message : std::string("it goes"));
      } catch (const Refused& refused) {
        return std::string(refused.what());
      }
    });
  }

  /// The result of the line, once all axes are at rest.
  std::string whatBecameOfIt() {
    if (line_.wait_for(kLongestAnswer) != std::future_status::ready) return "it has no answer";
    const bool rests = await([this] {
      return !axis("x").state().moving && !axis("y").state().moving && !axis("z").state().moving;
    });
    return rests ? line_.get() : "it has no end";
  }

  /// Requests a line while the clock is held, after y has begun to take up its backlash.
  void openWindow() {
    build(0.0, kBacklashOfY);
    held_.emplace(bench->clock);
    askForLine();
    ASSERT_TRUE(await([this] { return axis("y").state().moving; }));
  }
  void closeWindow() { held_.reset(); }

  void expectNothingBegan(const std::string& line, const std::string& why) {
    EXPECT_NE(line.find("the line did not begin: " + why), std::string::npos) << line;
    EXPECT_EQ(bench->pulses("x"), 0);
    EXPECT_LE(bench->pulses("y"), kBacklashSteps);
    const axis::AxisState y = axis("y").state();
    EXPECT_EQ(y.position, 0.0) << "the backlash is all that moved";
    EXPECT_EQ(y.target, y.position);
    EXPECT_FALSE(y.moving);
  }

  std::unique_ptr<Bench> bench;
  std::future<std::string> line_;
  std::optional<pulse::ClockHold> held_;
};

TEST_F(StopPromises, NoLineBeginsAfterAStopWhileBacklashIsTakenUp) {
  const std::vector<std::function<void()>> stops = {
      [this] { machine().stop(); },
      [this] { axis("x").stop(); },
      [this] { axis("y").stop(); },
  };
  for (std::size_t i = 0; i < stops.size(); ++i) {
    SCOPED_TRACE(i);
    openWindow();
    stops[i]();
    closeWindow();
    expectNothingBegan(whatBecameOfIt(), "it was stopped");
    EXPECT_EQ(machine().wait(machine().moveLine({{"x", "y"}, {0.05, 0.05}})).end,
              MoveEnd::kReached);
    EXPECT_EQ(bench->pulses("x"), 2000);
    EXPECT_EQ(bench->pulses("y"), 2000 + kBacklashSteps);
  }
}

TEST_F(StopPromises, NoLineBeginsAfterAStopWhileAnotherMoveComesToRest) {
  for (const std::string stopped : {"", "x", "y"}) {
    SCOPED_TRACE(stopped);
    build(1.0, 0.0);
    axis("x").jog(0.1);
    ASSERT_TRUE(await([this] { return axis("x").state().velocity > 0.05; }));
    held_.emplace(bench->clock);
    askForLine();
    ASSERT_TRUE(await([this] { return isAccepted([this] { axis("x").plan(0.0, true); }); }))
        << "it slows down: there is an end from which a move could be relative";
    stopped.empty() ? machine().stop() : axis(stopped).stop();
    closeWindow();
    const std::string line = whatBecameOfIt();
    EXPECT_NE(line.find("the line did not begin: it was stopped"), std::string::npos) << line;
    EXPECT_EQ(bench->pulses("y"), 0);
  }
}

TEST_F(StopPromises, NoStepGoesIntoAMotorThatIsDisabledBeforeTheLine) {
  openWindow();
  std::future<void> disabled = std::async(std::launch::async, [this] { axis("y").enable(false); });
  ASSERT_TRUE(await([this] { return !isAccepted([this] { axis("y").plan(0.01); }); }));
  closeWindow();
  ASSERT_EQ(disabled.wait_for(kLongestAnswer), std::future_status::ready);
  const std::int64_t pulses = bench->pulses("y");
  expectNothingBegan(whatBecameOfIt(), "it was disabled");
  EXPECT_EQ(bench->pulses("y"), pulses);
  EXPECT_FALSE(bench->report("y").energized);
}

TEST_F(StopPromises, NoLineIsAcceptedAfterAnEmergencyStop) {
  for (const bool recover : {false, true}) {
    SCOPED_TRACE(recover);
    openWindow();
    machine().emergencyStop();
    if (recover) machine().recover();
    closeWindow();
    expectNothingBegan(whatBecameOfIt(), "emergency stop");
    EXPECT_EQ(bench->pulses("y"), 0);
  }
}

TEST_F(StopPromises, AMoveInsteadOfALineIsHeldResumedAndOverriddenLikeAnyOther) {
  openWindow();
  const axis::Move move = axis("y").moveTo(0.02);
  machine().hold();
  closeWindow();
  const std::string line = whatBecameOfIt();
  EXPECT_EQ(line.find("accepted"), std::string::npos) << line;
  EXPECT_EQ(bench->pulses("x"), 0);
  machine().setSpeedOverride(0.5);
  EXPECT_FALSE(axis("y").result(move).has_value());
  machine().resume();
  EXPECT_EQ(axis("y").wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("y"), 800 + kBacklashSteps);
  EXPECT_EQ(bench->pulses("x"), 0);
}

TEST_F(StopPromises, AHoldBeforeALineKeepsItUntilItIsResumed) {
  openWindow();
  machine().hold();
  closeWindow();
  ASSERT_TRUE(await([this] { return !axis("y").state().moving; }));
  EXPECT_EQ(bench->pulses("x"), 0);
  EXPECT_LE(bench->pulses("y"), kBacklashSteps);
  machine().setSpeedOverride(0.5);
  EXPECT_EQ(bench->pulses("x"), 0);
  machine().resume();
  EXPECT_EQ(whatBecameOfIt(), "accepted: all axes reached their targets");
  EXPECT_EQ(bench->pulses("x"), 2000);
  EXPECT_EQ(bench->pulses("y"), 2000 + kBacklashSteps);
}

TEST_F(StopPromises, AnotherMotionInsteadOfALineIsNotStoppedForIt) {
  openWindow();
  const axis::Move move = axis("x").moveTo(-0.01);
  closeWindow();
  const std::string line = whatBecameOfIt();
  EXPECT_NE(line.find("x: the line did not begin: another command took over"), std::string::npos)
      << line;
  EXPECT_EQ(axis("x").wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), -400);
}

TEST_F(StopPromises, NobodyChangesWhereAnAxisOfALineStandsBeforeItBegins) {
  openWindow();
  EXPECT_REFUSED(axis("x").setPosition(0.01), "busy: it is about to move");
  closeWindow();
  EXPECT_EQ(whatBecameOfIt(), "accepted: all axes reached their targets");
  EXPECT_EQ(bench->pulses("x"), 2000);
}

}  // namespace
}  // namespace stepdriver
