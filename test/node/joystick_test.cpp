#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <sensor_msgs/Joy.h>
#include <std_srvs/SetBool.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Jog.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

/// A stepdriver_joystick for axis x of a node under test: stick 1, 0.05 m/s, a dead band of 0.2.
class JoystickTest : public testing::Test {
 protected:
  JoystickTest() {
    node.set("simulation/speed", 1.0);
    node.erase("axes/x/min_position_mm");
    set("axes/x/joystick_axis", 1);
    set("axes/x/max_speed_mm_s", 50.0);
    set("axes/x/dead_band", 0.2);
  }
  void TearDown() override {
    if (!joystick) return;
    joystick->signal(SIGTERM);
    EXPECT_EQ(joystick->waitForExit(kBound).value_or(-1), 0);
    if (HasFailure()) std::fputs(joystick->output().c_str(), stderr);
  }

  template <typename Value>
  void set(const std::string& key, const Value& value) {
    ros::param::set(node.beside("joystick/" + key), value);
  }

  void launch() {
    const std::string space = node.beside("");
    joystick = std::make_unique<NodeProcess>(
        std::vector<std::string>{"__ns:=" + space.substr(0, space.size() - 1), "__name:=joystick"},
        kStepdriverJoystick);
  }

  void start() {
    node.start();
    launch();
    publisher = ros::NodeHandle().advertise<sensor_msgs::Joy>(node.beside("joy"), 1);
    ASSERT_TRUE(waitUntil([this] { return publisher.getNumSubscribers() == 1; }));
    jogs = std::make_unique<Recorder<Jog>>(node.full("jog"));
    states = std::make_unique<Recorder<AxisStates>>(node.full("axis_states"));
    ASSERT_TRUE(
        waitUntil([this] { return says("Ready") && states->count() > 0 && jogs->connected(); }));
  }

  bool says(const std::string& words) {
    return joystick->output().find(words) != std::string::npos;
  }

  void publish(double stick, const std::vector<std::int32_t>& buttons = {}) {
    sensor_msgs::Joy message;
    message.axes = {0.0F, static_cast<float>(stick)};
    message.buttons = buttons;
    publisher.publish(message);
  }

  /// Holds the stick until a condition is true.
  bool holdUntil(double stick, const std::function<bool()>& happened,
                 const std::vector<std::int32_t>& buttons = {}) {
    return waitUntil([&] {
      publish(stick, buttons);
      return happened();
    });
  }

  bool enabled() { return states->messages().back().enabled.at(0) != 0; }
  bool moving() { return states->messages().back().moving.at(0) != 0; }
  double speed() { return states->messages().back().velocity.at(0); }
  bool jogsAt(double velocity) {
    const auto all = jogs->messages();
    return !all.empty() && std::abs(all.back().velocity.at(0) - velocity) < 1e-6;
  }
  std::size_t zeros() {
    const auto all = jogs->messages();
    return static_cast<std::size_t>(std::count_if(
        all.begin(), all.end(), [](const Jog& jog) { return jog.velocity.at(0) == 0.0; }));
  }

  NodeUnderTest node;
  std::unique_ptr<NodeProcess> joystick;
  ros::Publisher publisher;
  std::unique_ptr<Recorder<Jog>> jogs;
  std::unique_ptr<Recorder<AxisStates>> states;
};

TEST_F(JoystickTest, JogsNothingByAMessageThatWasLatchedBeforeItsStart) {
  publisher = ros::NodeHandle().advertise<sensor_msgs::Joy>(node.beside("joy"), 1, true);
  publish(1.0);
  node.start();
  jogs = std::make_unique<Recorder<Jog>>(node.full("jog"));
  launch();
  EXPECT_TRUE(waitUntil([this] { return says(", which latches") || jogs->count() > 0; }));
  EXPECT_TRUE(says(node.beside("joy") + ": a message of")) << joystick->output();
  EXPECT_EQ(node.pulses(), 0);
  EXPECT_TRUE(holdUntil(1.0, [this] { return node.pulses() > 0; })) << "newer ones";
}

TEST_F(JoystickTest, JogsTheAxisAsFarAsTheStickIsOut) {
  start();
  EXPECT_TRUE(holdUntil(0.6, [&] { return std::abs(speed() - 0.025) < 1e-6; }))
      << "half of the way beyond the dead band, half of the speed";
  EXPECT_EQ(jogs->messages().back().name, std::vector<std::string>{"x"});
  EXPECT_TRUE(holdUntil(1.0, [&] { return std::abs(speed() - 0.05) < 1e-6; }));
  EXPECT_TRUE(holdUntil(-1.0, [&] { return std::abs(speed() + 0.05) < 1e-6; }));
  EXPECT_TRUE(holdUntil(0.0, [&] { return !moving(); }));
  EXPECT_EQ(node.rig().violations.at(0), 0U) << node.rig().violation_kinds.at(0);
}

TEST_F(JoystickTest, RepeatsTheJogWithoutAnotherMessageAndEndsItOnce) {
  set("joy_timeout", 60.0);
  start();
  ASSERT_TRUE(holdUntil(1.0, [&] { return jogsAt(0.05); }));
  const std::size_t before = jogs->count();
  ASSERT_TRUE(waitUntil([&] { return jogs->count() > before + 40; }))
      << "40 at 25 Hz: three times the driver's jog_timeout";
  EXPECT_EQ(zeros(), 0U);
  EXPECT_EQ(node.process().output().find("no jog for"), std::string::npos);
  ASSERT_TRUE(holdUntil(0.1, [&] { return !moving() && speed() == 0.0; })) << "in the dead band";
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(zeros(), 1U);
  EXPECT_TRUE(jogsAt(0.0)) << "nothing comes after it";
}

TEST_F(JoystickTest, LeavesTheAxisToOthersInTheDeadBand) {
  start();
  const auto move = node.moveTo(0.01, false);
  ASSERT_TRUE(move.success) << move.message;
  EXPECT_TRUE(holdUntil(0.2, [&] { return node.pulses() == 800; }));
  EXPECT_EQ(jogs->count(), 0U);
}

TEST_F(JoystickTest, EndsTheJogWhenTheJoystickFallsSilent) {
  set("joy_timeout", 0.3);
  node.set("jog_timeout", 60.0);
  start();
  ASSERT_TRUE(holdUntil(0.5, [&] { return moving(); }));
  EXPECT_TRUE(waitUntil([&] { return !moving() && zeros() == 1; }));
  EXPECT_TRUE(says("x: no message from the joystick for 0.3 s, so the jog ends"));
}

TEST_F(JoystickTest, JogsOnlyWhileTheDeadmanButtonIsHeld) {
  set("deadman_button", 1);
  start();
  EXPECT_TRUE(holdUntil(1.0, [&] { return moving(); }, {0, 1}));
  EXPECT_TRUE(holdUntil(1.0, [&] { return !moving(); }, {1, 0}));
  const std::size_t before = jogs->count();
  for (int i = 0; i < 20; ++i) {
    publish(1.0, {1, 0});
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(jogs->count(), before);
}

TEST_F(JoystickTest, EndsTheJogByAMessageThatItCannotUnderstand) {
  set("deadman_button", 1);
  start();
  const std::vector<std::pair<std::vector<float>, std::string>> bad = {
      {{0.0F}, "the message has 1 axes, but x is jogged by joystick_axis 1"},
      {{0.0F, std::numeric_limits<float>::quiet_NaN()}, "is nan, but must be a finite number"}};
  for (const auto& [axes, words] : bad) {
    ASSERT_TRUE(holdUntil(0.5, [&] { return moving(); }, {0, 1}));
    sensor_msgs::Joy message;
    message.axes = axes;
    message.buttons = {0, 1};
    const std::string said = words;
    EXPECT_TRUE(waitUntil([&] {
      publisher.publish(message);
      return !moving() && says(said);
    })) << words;
  }
  EXPECT_TRUE(holdUntil(
      1.0, [&] { return says("the message has 1 buttons, but deadman_button is 1"); }, {1}));
}

TEST_F(JoystickTest, DisablesInTheDeadBandAndEnablesBeforeItJogs) {
  node.set("axes/x/enable_on_start", false);
  set("axes/x/disable_in_dead_band", true);
  set("axes/x/disable_after_s", 0.2);
  start();
  for (int i = 0; i < 2; ++i) {
    const std::int64_t pulses = node.pulses();
    EXPECT_FALSE(enabled());
    EXPECT_TRUE(holdUntil(0.8, [&] { return enabled() && node.pulses() > pulses; })) << i;
    EXPECT_TRUE(holdUntil(0.0, [&] { return !moving() && !enabled(); })) << i;
  }
  EXPECT_EQ(node.rig().violations.at(0), 0U) << node.rig().violation_kinds.at(0);
  EXPECT_EQ(node.process().output().find("jog:"), std::string::npos) << "no jog was refused";
}

TEST_F(JoystickTest, JogsOtherAxesWhileAServiceWaits) {
  // The test takes the place of the driver.
  set("driver", "other");
  set("axes/slow/joystick_axis", 0);
  set("axes/slow/max_speed_mm_s", 10.0);
  set("axes/slow/disable_in_dead_band", true);
  std::atomic<bool> asked{false};
  std::atomic<bool> free{false};
  std::atomic<bool> answered{false};
  const auto slow =
      ros::NodeHandle().advertiseService<std_srvs::SetBoolRequest, std_srvs::SetBoolResponse>(
          node.beside("other/slow/enable"), [&](auto& /*request*/, auto& response) {
            asked = true;
            waitUntil([&] { return free.load(); });
            answered = true;
            response.success = true;
            return true;
          });
  const Recorder<Jog> sent(node.beside("other/jog"));
  launch();
  publisher = ros::NodeHandle().advertise<sensor_msgs::Joy>(node.beside("joy"), 1);
  ASSERT_TRUE(waitUntil([&] { return publisher.getNumSubscribers() == 1 && sent.connected(); }));
  sensor_msgs::Joy both;
  both.axes = {1.0F, 1.0F};
  const auto hold_both_until = [&](const std::function<bool()>& happened) {
    return waitUntil([&] {
      publisher.publish(both);
      return happened();
    });
  };
  ASSERT_TRUE(hold_both_until([&] { return asked.load(); }));
  const std::size_t before = sent.count();
  EXPECT_TRUE(hold_both_until([&] { return sent.count() > before + 10; }));
  EXPECT_FALSE(answered) << "they came while the service was waiting";
  EXPECT_EQ(sent.messages().back().name, std::vector<std::string>{"x"});
  free = true;
  EXPECT_TRUE(hold_both_until([&] { return sent.messages().back().name.size() == 2; }));
}

TEST_F(JoystickTest, SaysWhatKeepsAnAxisFromBeingEnabled) {
  node.erase("axes/x/pins/enable");
  node.erase("axes/x/enable_on_start");
  set("axes/x/disable_in_dead_band", true);
  start();
  EXPECT_TRUE(holdUntil(1.0, [&] { return says("x/enable: x: pins/enable isn't configured"); }));
  EXPECT_EQ(jogs->count(), 0U);
}

TEST_F(JoystickTest, WarnsOfARateThatTheDriverTakesForSilence) {
  node.set("jog_timeout", 0.7);
  set("rate", 4.0);
  start();
  EXPECT_TRUE(says("Use 5 Hz or more")) << joystick->output();
}

TEST_F(JoystickTest, DoesNotStartWithParametersThatAreWrong) {
  set("axes/x/dead_band", 1.5);
  set("axes/x/max_sped_mm_s", 5.0);
  set("driver", "my node");
  launch();
  EXPECT_EQ(joystick->waitForExit(kBound).value_or(-1), 1);
  expectSays(joystick->output(), "Not started: 3 errors in the parameters");
  expectSays(joystick->output(),
             node.beside("joystick/axes/x/dead_band") + " is 1.5, but must be from 0 to 0.99");
  expectSays(joystick->output(), "did you mean max_speed_mm_s?");
  expectSays(joystick->output(), "is \"my node\", but must be the name of a node");
  joystick.reset();
}

TEST_F(JoystickTest, DoesNotStartForAxesThatTheDriverDoesNotHave) {
  set("axes/x/max_speed_mm_s", 100.1);
  set("axes/y/joystick_axis", 0);
  set("axes/y/max_speed_mm_s", 5.0);
  launch();
  EXPECT_EQ(joystick->waitForExit(kBound).value_or(-1), 1);
  expectSays(joystick->output(), node.beside("joystick/axes/x/max_speed_mm_s") +
                                     " is 100.1, but must be at most " +
                                     node.full("axes/x/max_speed_mm_s") + ", which is 100.0");
  expectSays(joystick->output(), "isn't an axis of " + node.name() + ", which has x");
  joystick.reset();
}

TEST(JoystickByHand, HelpExplainsAndUnknownArgumentsAreRefused) {
  NodeProcess help({"--help"}, kStepdriverJoystick);
  EXPECT_EQ(help.waitForExit(kBound).value_or(-1), 0);
  expectSays(help.output(), "usage: stepdriver_joystick");
  NodeProcess unknown({"--hlep"}, kStepdriverJoystick);
  EXPECT_EQ(unknown.waitForExit(kBound).value_or(0), 64);
}

}  // namespace
}  // namespace stepdriver::node_test
