#include "session.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/axes.h"

namespace stepdriver::console {
namespace {

bool said(const Session& session, const std::string& words) {
  for (const auto& message : session.messages().all()) {
    if (message.text.find(words) != std::string::npos) return true;
  }
  return false;
}

TEST(Session, NothingMovesWithoutAKey) {
  Session session = sessionWith({axisView("x")});
  for (double now = 0.0; now < 0.9; now += 0.02) {
    const Orders orders = session.tick(now);
    EXPECT_TRUE(orders.jogs.empty() && orders.calls.empty() && !orders.emergency_stop) << now;
  }
}

TEST(Session, AKeyJogsForAShortWhileAndEndsWithZeroOnce) {
  Session session = sessionWith({axisView("x")});
  session.press({kKeyRight}, 0.0);
  std::vector<double> velocities;
  double last = 0.0;
  for (double now = 0.0; now < 0.9; now += 0.01) {
    for (const auto& order : session.tick(now).jogs) {
      velocities.push_back(order.velocity);
      if (order.velocity != 0.0) last = now;
    }
  }
  ASSERT_GE(velocities.size(), 3U);
  EXPECT_NEAR(velocities.front(), 5.0, 1e-9) << "5 % of 100 mm/s";
  EXPECT_EQ(velocities.back(), 0.0);
  EXPECT_NE(velocities[velocities.size() - 2], 0.0) << "one zero";
  EXPECT_LT(last, HeldJog::kHold);
}

TEST(Session, RepeatsProlongAJog) {
  Session session = sessionWith({axisView("x")});
  for (int repeat = 0; repeat < 20; ++repeat) {
    const double now = 0.04 * repeat;
    session.press({','}, now);
    for (const auto& order : session.tick(now).jogs) EXPECT_NEAR(order.velocity, -5.0, 1e-9);
  }
  EXPECT_TRUE(session.jog().active());
}

TEST(Session, JogsOnlyAnAxisThatIsEnabledAndLiveAndWithoutAFault) {
  AxisView disabled = axisView("x");
  disabled.enabled = false;
  Session off = sessionWith({disabled});
  EXPECT_TRUE(off.press({kKeyRight, '+', 'h'}, 0.0).calls.empty());
  EXPECT_TRUE(off.tick(0.0).jogs.empty());
  EXPECT_TRUE(said(off, "x isn't moved: it isn't enabled; e enables it"));

  AxisView idle = disabled;
  idle.idle = true;
  Session asleep = sessionWith({idle});
  asleep.press({kKeyRight}, 0.0);
  EXPECT_TRUE(asleep.tick(0.0).jogs.empty()) << "a motion would take its current back";

  AxisView faulty = axisView("x");
  faulty.fault = "emergency stop";
  Session fault = sessionWith({faulty});
  fault.press({kKeyRight}, 0.0);
  EXPECT_TRUE(fault.tick(0.0).jogs.empty());

  Session old = sessionWith({axisView("x")});
  EXPECT_TRUE(old.press({kKeyRight, '+', 'h', 'a'}, 2.0).calls.empty());
  EXPECT_TRUE(old.tick(2.0).jogs.empty());
  EXPECT_TRUE(said(old, "isn't live"));
}

TEST(Session, AJogEndsWhereTheStateGoesStale) {
  Session session = sessionWith({axisView("x")});
  session.press({kKeyRight}, 0.95);
  EXPECT_EQ(session.tick(0.95).jogs.size(), 1U);
  const Orders orders = session.tick(1.05);
  ASSERT_EQ(orders.jogs.size(), 1U);
  EXPECT_EQ(orders.jogs[0].velocity, 0.0);
}

TEST(Session, AnyOtherKeyEndsAJog) {
  for (const Key key : {Key{'j'}, Key{'?'}, Key{'s'}, Key{'e'}, kKeyCtrlC}) {
    Session session = sessionWith({axisView("x"), axisView("y")});
    session.press({kKeyRight}, 0.0);
    session.tick(0.0);
    const Orders orders = session.press({key}, 0.05);
    ASSERT_EQ(orders.jogs.size(), 1U) << key;
    EXPECT_EQ(orders.jogs[0].axis, "x");
    EXPECT_EQ(orders.jogs[0].velocity, 0.0);
  }
}

TEST(Session, SpaceComesBeforeAllThatWasTypedWithIt) {
  Session session = sessionWith({axisView("x")});
  const Orders orders = session.press({'+', kKeyRight, 'h', 'q', ' ', '+'}, 0.0);
  EXPECT_TRUE(orders.emergency_stop);
  EXPECT_TRUE(orders.calls.empty());
  EXPECT_TRUE(session.tick(0.0).jogs.empty());
  EXPECT_FALSE(session.ended());
  EXPECT_EQ(session.emergency(), Session::Emergency::kSent);
}

TEST(Session, SpaceAndStopAreSentWhateverTheStateIs) {
  Session session("/stepdriver", {});
  EXPECT_TRUE(session.press({' '}, 100.0).emergency_stop);
  EXPECT_EQ(session.press({'s'}, 100.0).calls.size(), 1U);
}

TEST(Session, KeepsTheEmergencyStopOnTheScreenUntilItIsRecovered) {
  Session session = sessionWith({axisView("x")});
  session.press({' '}, 0.0);
  session.emergencyAnswered(true, "all axes are stopped");
  EXPECT_EQ(session.emergency(), Session::Emergency::kStopped);
  session.update({axisView("x")}, 0.1);
  EXPECT_EQ(session.emergency(), Session::Emergency::kStopped) << "a state from before the stop";
  AxisView stopped = axisView("x");
  stopped.fault = "emergency stop";
  session.update({stopped}, 0.2);
  EXPECT_EQ(session.emergency(), Session::Emergency::kStopped);
  session.update({axisView("x")}, 0.3);
  EXPECT_EQ(session.emergency(), Session::Emergency::kNone) << "another one has recovered";
}

TEST(Session, AnEmergencyStopWithoutAnAnswerHasFailed) {
  Session session = sessionWith({axisView("x")});
  session.press({' '}, 0.0);
  session.emergencyAnswered(false, "nobody answers");
  EXPECT_EQ(session.emergency(), Session::Emergency::kFailed);
}

TEST(Session, AStepIsOneMicrostepInTheModeOfNow) {
  AxisView axis = axisView("x");
  axis.microsteps = 8;
  Session session = sessionWith({axis});
  const Orders orders = session.press({'-'}, 0.0);
  ASSERT_EQ(orders.calls.size(), 1U);
  EXPECT_EQ(orders.calls[0].what, Call::What::kStep);
  EXPECT_NEAR(orders.calls[0].distance, -0.001 / 40.0, 1e-15) << "80 steps/mm at 16, 40 at 8";
}

TEST(Session, SendsACallOnceWhileItIsUnderWay) {
  Session session = sessionWith({axisView("x")});
  EXPECT_EQ(session.press({'h'}, 0.0).calls.size(), 1U);
  EXPECT_EQ(session.press({'h'}, 0.1).calls.size(), 0U);
  EXPECT_TRUE(said(session, "x: home: not sent again"));
  EXPECT_EQ(session.press({'s'}, 0.1).calls.size(), 1U) << "a stop waits for nothing";
  session.answered({Call::What::kHome, "x"}, false, "x: homing isn't configured");
  EXPECT_TRUE(said(session, "x: home REFUSED: x: homing isn't configured"));
  EXPECT_EQ(session.press({'h'}, 0.2).calls.size(), 1U);
}

TEST(Session, ChoosesAxesInARing) {
  Session session = sessionWith({axisView("x"), axisView("y"), axisView("z")});
  EXPECT_EQ(session.chosen(), "x");
  session.press({kKeyUp}, 0.0);
  EXPECT_EQ(session.chosen(), "z");
  session.press({kKeyDown, kKeyDown}, 0.0);
  EXPECT_EQ(session.chosen(), "y");
  session.press({'3'}, 0.0);
  EXPECT_EQ(session.chosen(), "z");
  session.press({'4'}, 0.0);
  EXPECT_EQ(session.chosen(), "z");
}

}  // namespace
}  // namespace stepdriver::console
