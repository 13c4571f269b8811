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

TEST(Session, SwitchesTheChosenOutputToTheOtherState) {
  Session session = sessionWith({axisView("x")});
  session.driver().updateIo({{"lamp", false, {}, "", ""}, {"pen", true, 0.0, "", ""}}, {});
  const auto switched = [&](const Orders& orders) {
    if (orders.calls.size() != 1) return std::string("no call");
    const Call& call = orders.calls.front();
    return call.name() + (call.on ? " on" : " off");
  };
  EXPECT_EQ(switched(session.press({'t'}, 0.0)), "lamp: switch on");
  EXPECT_EQ(switched(session.press({'n', 't'}, 0.0)), "pen: switch off");
  EXPECT_EQ(switched(session.press({'t'}, 0.0)), "no call") << "the last one isn't answered";
  EXPECT_TRUE(said(session, "pen: switch: not sent again"));
  EXPECT_EQ(session.press({'n'}, 0.0).calls.size(), 0U);
  EXPECT_EQ(session.chosenOutput()->name, "lamp") << "after the last one comes the first";
  // The state is the driver's: an answer alone doesn't change it.
  Call answered{Call::What::kSetOutput, {}};
  answered.output = "lamp";
  session.answered(answered, true, "lamp is on");
  EXPECT_FALSE(session.chosenOutput()->on);
  session.driver().updateIo({{"lamp", true, 0.0, "", ""}, {"pen", true, 0.0, "", ""}}, {});
  EXPECT_EQ(switched(session.press({'t'}, 0.0)), "lamp: switch off");
}

TEST(Session, EndsThePositionCompareOfTheChosenOutput) {
  Session session = sessionWith({axisView("x")});
  EXPECT_TRUE(session.press({'u'}, 0.0).calls.empty());
  EXPECT_TRUE(said(session, "the driver has no output with a name"));
  session.driver().updateIo({{"pen", true, 0.0, "", ""}, {"camera", false, 0.0, "", "", "x"}}, {});
  EXPECT_TRUE(session.press({'u'}, 0.0).calls.empty());
  EXPECT_TRUE(said(session, "pen isn't changed: no position switches it"));
  const Orders orders = session.press({'n', 'u'}, 0.0);
  ASSERT_EQ(orders.calls.size(), 1U);
  EXPECT_EQ(orders.calls.front().what, Call::What::kEndCompare);
  EXPECT_EQ(orders.calls.front().name(), "camera: end position compare");
  EXPECT_TRUE(session.press({'u'}, 2.0).calls.empty());
  EXPECT_TRUE(said(session, "camera isn't changed: the driver's state isn't live"));
}

TEST(Session, SwitchesNoOutputThatIsNotThereOrWhoseStateIsOld) {
  Session session = sessionWith({axisView("x")});
  EXPECT_TRUE(session.press({'n', 't'}, 0.0).calls.empty());
  EXPECT_TRUE(said(session, "the driver has no output with a name"));
  session.driver().updateIo({{"pen", true, 0.0, "", ""}}, {});
  EXPECT_TRUE(session.press({'t'}, 2.0).calls.empty());
  EXPECT_TRUE(said(session, "pen isn't switched: the driver's state isn't live"));
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

TEST(Session, TheStepSizeGoesRound) {
  Session session = sessionWith({axisView("x")});
  const auto stepped = [&](double now) {
    const Orders orders = session.press({'+'}, now);
    if (orders.calls.size() != 1) return -1.0;
    session.answered(orders.calls[0], true, "");
    return orders.calls[0].distance * 1e3;
  };
  for (const double wanted : {0.0125, 0.1, 1.0, 10.0, 0.0125}) {
    EXPECT_NEAR(stepped(0.0), wanted, 1e-12);
    session.press({'i'}, 0.0);
  }
}

TEST(Session, StepsOfARotaryAxisAreDegrees) {
  config::AxisConfig config = axisConfig("r");
  config.kind = config::Kind::kRotary;
  Session session = sessionWith({axisView("r")}, {config});
  const Orders orders = session.press({'i', 'i', '-'}, 0.0);
  ASSERT_EQ(orders.calls.size(), 1U);
  EXPECT_NEAR(orders.calls[0].distance, -3.14159265358979 / 180.0, 1e-12);
}

/// An axis with soft limits at 0 and 200 mm.
config::AxisConfig limitedConfig() {
  config::AxisConfig config = axisConfig("x");
  config.min_position = 0.0;
  config.max_position = 0.2;
  return config;
}

std::vector<Key> keysOf(const std::string& text) { return {text.begin(), text.end()}; }

TEST(Session, GoesToATypedPositionInMm) {
  Session session = sessionWith({axisView("x")}, {limitedConfig()});
  EXPECT_TRUE(session.press(keysOf("g1"), 0.0).calls.empty());
  ASSERT_NE(session.prompt(), nullptr);
  EXPECT_TRUE(session.press(keysOf("29"), 0.1).calls.empty()) << "the second axis isn't chosen";
  EXPECT_TRUE(session.press({kKeyBackspace, '.', '5'}, 0.2).calls.empty());
  EXPECT_EQ(session.prompt()->text(), "12.5");
  const Orders orders = session.press({kKeyEnter}, 0.3);
  ASSERT_EQ(orders.calls.size(), 1U);
  EXPECT_EQ(orders.calls[0].what, Call::What::kGoTo);
  EXPECT_EQ(orders.calls[0].axis, "x");
  EXPECT_NEAR(orders.calls[0].position, 0.0125, 1e-15);
  EXPECT_EQ(session.prompt(), nullptr);
}

TEST(Session, ARotaryAxisGoesToDegrees) {
  config::AxisConfig config = axisConfig("r");
  config.kind = config::Kind::kRotary;
  Session session = sessionWith({axisView("r")}, {config});
  const Orders orders = session.press(keysOf("g-180\n"), 0.0);
  ASSERT_EQ(orders.calls.size(), 1U);
  EXPECT_NEAR(orders.calls[0].position, -3.14159265358979, 1e-12);
}

TEST(Session, APositionThatCannotBeReachedIsRefusedAndNotSent) {
  config::AxisConfig open = limitedConfig();
  open.max_position.reset();
  struct Wanted {
    std::string typed;
    std::string said;
    config::AxisConfig config;
  };
  for (const Wanted& wanted : {
           Wanted{"250",
                  "x isn't moved: 250.0000 mm is outside its limits, 0.0000 mm to 200.0000 mm",
                  limitedConfig()},
           {"-0.1", "x isn't moved: -0.1000 mm is outside its limits, 0.0000 mm to 200.0000 mm",
            limitedConfig()},
           {"-1", "x isn't moved: -1.0000 mm is outside its limits, 0.0000 mm and above", open},
           {"1.2.3", "x isn't moved: \"1.2.3\" isn't a number in mm, from 0.0000 mm to 200.0000 mm",
            limitedConfig()},
           {"", "x isn't moved: \"\" isn't a number in mm", axisConfig("x")},
           {"--5", "x isn't moved: \"--5\" isn't a number in mm", axisConfig("x")},
       }) {
    Session session = sessionWith({axisView("x")}, {wanted.config});
    EXPECT_TRUE(session.press(keysOf("g" + wanted.typed + "\n"), 0.0).calls.empty());
    const auto& all = session.messages().all();
    EXPECT_TRUE(said(session, wanted.said)) << (all.empty() ? "nothing is said" : all.back().text);
  }
  Session session = sessionWith({axisView("x")}, {limitedConfig()});
  EXPECT_EQ(session.press(keysOf("g200\n"), 0.0).calls.size(), 1U) << "a limit can be reached";
}

TEST(Session, APositionIsTypedOnlyForAnAxisThatMayMove) {
  AxisView disabled = axisView("x");
  disabled.enabled = false;
  Session session = sessionWith({disabled});
  EXPECT_TRUE(session.press(keysOf("g10\n"), 0.0).calls.empty());
  EXPECT_TRUE(said(session, "x isn't moved: it isn't enabled"));

  Session later = sessionWith({axisView("x")});
  later.press(keysOf("g10"), 0.0);
  EXPECT_TRUE(later.press({kKeyEnter}, 2.0).calls.empty()) << "the state is old by now";
  later.update({axisView("x")}, 3.0);
  later.press(keysOf("g10"), 3.0);
  later.update({disabled}, 3.1);
  EXPECT_TRUE(later.press({kKeyEnter}, 3.2).calls.empty()) << "it was disabled meanwhile";
}

TEST(Session, EscapeCancelsTypingAndSendsNothing) {
  Session session = sessionWith({axisView("x")});
  const Orders orders = session.press({'g', '1', kKeyEscape}, 0.0);
  EXPECT_TRUE(orders.calls.empty());
  EXPECT_EQ(session.prompt(), nullptr);
  EXPECT_EQ(session.press({kKeyEscape}, 0.1).calls.size(), 1U) << "now it stops";
}

TEST(Session, StopsWorkWhileAPositionIsTyped) {
  Session session = sessionWith({axisView("x")});
  session.press(keysOf("g1"), 0.0);
  EXPECT_TRUE(session.press({'0', ' ', kKeyEnter}, 0.1).emergency_stop);
  EXPECT_EQ(session.prompt(), nullptr) << "nothing is left to be entered by mistake";
  session.press(keysOf("g1"), 0.2);
  const Orders orders = session.press(keysOf("s"), 0.3);
  ASSERT_EQ(orders.calls.size(), 1U);
  EXPECT_EQ(orders.calls[0].what, Call::What::kStop);
  EXPECT_EQ(session.prompt(), nullptr);
  session.press(keysOf("g1"), 0.4);
  session.press({kKeyCtrlC}, 0.5);
  EXPECT_TRUE(session.ended());
}

TEST(Session, LettersThatAreTypedIntoAPositionDoNothingElse) {
  Session session = sessionWith({axisView("x"), axisView("y")});
  session.press({'g'}, 0.0);
  const Orders orders = session.press({'e', 'd', 'h', 'a', 'q', '2', kKeyDown}, 0.1);
  EXPECT_TRUE(orders.calls.empty());
  EXPECT_FALSE(session.ended());
  EXPECT_EQ(session.chosen(), "x");
  ASSERT_NE(session.prompt(), nullptr);
  EXPECT_EQ(session.prompt()->text(), "2");
}

/// The axes that keys enable or disable, as their calls say it.
std::vector<std::string> callsOf(Session& session, const std::vector<Key>& keys) {
  std::vector<std::string> names;
  for (const Call& call : session.press(keys, 0.0).calls) names.push_back(call.name());
  return names;
}

TEST(Session, DigitsAfterARefusedGoToDoNothing) {
  AxisView disabled = axisView("x");
  disabled.enabled = false;
  Session session = sessionWith({disabled, axisView("y")});
  EXPECT_EQ(callsOf(session, keysOf("g2d")), std::vector<std::string>{});
  EXPECT_EQ(session.chosen(), "x");
  EXPECT_EQ(callsOf(session, keysOf("-1.5deg+,eh")), std::vector<std::string>{});
  EXPECT_TRUE(session.tick(0.0).jogs.empty());
  EXPECT_EQ(session.chosen(), "x");
  ASSERT_NE(session.closedPrompt(), nullptr);
  EXPECT_EQ(callsOf(session, {kKeyEnter}), std::vector<std::string>{});
  EXPECT_EQ(session.closedPrompt(), nullptr);
  EXPECT_EQ(callsOf(session, keysOf("2e")), std::vector<std::string>{"y: enable"});
}

TEST(Session, WhatIsTypedIntoAClosedPromptDoesNothing) {
  // How the prompt was closed, before the user has finished.
  for (const std::string closed : {"g1s", "g1 ", "g9999\n", "g1.2.3\n", "g\n"}) {
    Session session =
        sessionWith({axisView("x"), axisView("y")}, {limitedConfig(), limitedConfig()});
    for (const char key : closed) session.press({Key(key)}, 0.0);
    for (const char key : std::string("2deg")) {
      EXPECT_EQ(callsOf(session, {Key(key)}), std::vector<std::string>{}) << closed;
    }
    EXPECT_EQ(session.chosen(), "x") << closed;
    EXPECT_EQ(callsOf(session, {kKeyEscape}), std::vector<std::string>{}) << closed;
    EXPECT_EQ(callsOf(session, {'e'}), std::vector<std::string>{"x: enable"}) << closed;
  }
}

TEST(Session, StopsWorkWhileTypingIsLeftOver) {
  AxisView disabled = axisView("x");
  disabled.enabled = false;
  Session session = sessionWith({disabled});
  session.press(keysOf("g12"), 0.0);
  EXPECT_EQ(callsOf(session, {'s'}), std::vector<std::string>{"all axes: stop"});
  EXPECT_TRUE(session.press({' '}, 0.1).emergency_stop);
  session.press({kKeyCtrlC}, 0.2);
  EXPECT_TRUE(session.ended());
}

TEST(Session, ObeysAKeyAfterARefusedGoToIfNothingWasTyped) {
  AxisView disabled = axisView("x");
  disabled.enabled = false;
  Session session = sessionWith({disabled, axisView("y")});
  EXPECT_EQ(callsOf(session, keysOf("ge")), std::vector<std::string>{"x: enable"})
      << "as the refusal says";
  session.press({'g'}, 0.0);
  session.press({kKeyDown}, 0.0);
  EXPECT_EQ(session.chosen(), "y");
}

TEST(Session, SwitchesAllMotorsOnAndOff) {
  Session session = sessionWith({axisView("x"), axisView("y")});
  EXPECT_EQ(callsOf(session, keysOf("mo")),
            (std::vector<std::string>{"all axes: enable", "all axes: disable"}));
}

TEST(Session, SetsZeroOnlyAtRest) {
  AxisView axis = axisView("x");
  axis.enabled = false;
  Session session = sessionWith({axis});
  Orders orders = session.press({'z', 'y'}, 0.0);
  ASSERT_EQ(orders.calls.size(), 1U) << "nothing moves, so it needn't be enabled";
  EXPECT_EQ(orders.calls[0].what, Call::What::kSetZero);
  session.answered(orders.calls[0], true, "");
  axis.moving = true;
  session.update({axis}, 0.1);
  EXPECT_TRUE(session.press({'z'}, 0.1).calls.empty());
  EXPECT_TRUE(said(session, "x: the position isn't set because the axis is moving"));
  axis.moving = false;
  session.update({axis}, 0.2);
  EXPECT_TRUE(session.press({'z', 'y'}, 3.0).calls.empty())
      << "it isn't known whether it is at rest";
}

TEST(Session, SetsZeroOnlyIfTheUserSaysYes) {
  Session session = sessionWith({axisView("x"), axisView("y")});
  for (const Key key : {Key('n'), Key('z'), Key('h'), Key('q'), kKeyEnter, kKeyEscape, kKeyDown}) {
    session.press({'z'}, 0.0);
    ASSERT_EQ(session.zeroAsked(), "x");
    const Orders orders = session.press({key}, 0.0);
    EXPECT_TRUE(orders.calls.empty()) << key;
    EXPECT_FALSE(session.zeroAsked().has_value()) << key;
  }
  EXPECT_TRUE(said(session, "x: its position stays as it is"));
  EXPECT_FALSE(session.ended());
  EXPECT_EQ(session.chosen(), "x");

  Orders orders = session.press({'z', 's', 'y'}, 0.0);
  ASSERT_EQ(orders.calls.size(), 1U);
  EXPECT_EQ(orders.calls[0].what, Call::What::kStop);
  orders = session.press({'z'}, 0.0);
  orders = session.press({' ', 'y'}, 0.0);
  EXPECT_TRUE(orders.emergency_stop);
  EXPECT_TRUE(session.press({'y'}, 0.0).calls.empty()) << "the question is over";
  session.press({'z', kKeyCtrlC}, 0.0);
  EXPECT_TRUE(session.ended());
}

TEST(Session, DoesNotSetZeroIfTheAxisHasBegunToMoveMeanwhile) {
  AxisView axis = axisView("x");
  Session session = sessionWith({axis});
  session.press({'z'}, 0.0);
  axis.moving = true;
  session.update({axis}, 0.1);
  EXPECT_TRUE(session.press({'y'}, 0.1).calls.empty());
  EXPECT_TRUE(said(session, "x: the position isn't set because the axis is moving"));
}

TEST(Session, HoldsInAnyStateAndResumesOnlyALiveOne) {
  Session session("/stepdriver", {});
  Orders orders = session.press({'p', 'c'}, 0.0);
  ASSERT_EQ(orders.calls.size(), 1U);
  EXPECT_EQ(orders.calls[0].what, Call::What::kHold);
  EXPECT_TRUE(said(session, "nothing is resumed: the driver's state isn't live"));
  AxisView held = axisView("x");
  held.held = true;
  Session live = sessionWith({held});
  orders = live.press({'c', '+', 'h', 'g'}, 0.0);
  ASSERT_EQ(orders.calls.size(), 1U);
  EXPECT_EQ(orders.calls[0].what, Call::What::kResume);
  EXPECT_TRUE(said(live, "x isn't moved: it is on hold; c resumes, s stops"));
}

/// The factor that a key sends; 0: none.
double sentFactor(Session& session, Key key, double now) {
  const Orders orders = session.press({key}, now);
  if (orders.calls.size() != 1) return 0.0;
  session.answered(orders.calls[0], true, "");
  return orders.calls[0].what == Call::What::kSpeedOverride ? orders.calls[0].factor : 0.0;
}

TEST(Session, ChangesTheOverrideInStepsOfTenPercent) {
  Session session = sessionWith({axisView("x")});
  EXPECT_EQ(session.speedOverride(), 1.0);
  EXPECT_NEAR(sentFactor(session, '[', 0.0), 0.9, 1e-12);
  EXPECT_NEAR(*session.speedOverride(), 0.9, 1e-12);
  EXPECT_NEAR(sentFactor(session, ']', 0.0), 1.0, 1e-12);
  for (int percent = 90; percent >= 10; percent -= 10) {
    EXPECT_NEAR(sentFactor(session, '[', 0.0), percent / 100.0, 1e-12);
  }
  EXPECT_EQ(sentFactor(session, '[', 0.0), 0.0);
  EXPECT_TRUE(said(session, "the override stays at 10 %: it can be 10 to 200 %"));
  for (int percent = 20; percent <= 200; percent += 10) {
    EXPECT_NEAR(sentFactor(session, ']', 0.0), percent / 100.0, 1e-12);
  }
  EXPECT_EQ(sentFactor(session, ']', 0.0), 0.0);
}

TEST(Session, ChangesTheOverrideThatTheDriverHasWhoeverSetIt) {
  AxisView slow = axisView("x");
  slow.speed_override = 0.2;
  Session session = sessionWith({slow});
  EXPECT_NEAR(sentFactor(session, '[', 0.0), 0.1, 1e-12);
  session.update({slow}, 0.1);
  EXPECT_NEAR(sentFactor(session, ']', 0.1), 0.3, 1e-12);
  session.tick(2.1);
  EXPECT_FALSE(session.speedOverride()) << "the driver may have been restarted";
  EXPECT_EQ(sentFactor(session, ']', 2.1), 0.0) << "nothing becomes faster unseen";
  EXPECT_TRUE(said(session, "the override isn't changed: the driver's state isn't live"));
}

TEST(Session, ARefusedOverrideIsNotShown) {
  Session session = sessionWith({axisView("x")});
  const Orders orders = session.press({'['}, 0.0);
  ASSERT_EQ(orders.calls.size(), 1U);
  session.answered(orders.calls[0], false, "nobody answers");
  EXPECT_EQ(session.speedOverride(), 1.0);
}

TEST(Session, TellsWhatTheDriverSaysInMm) {
  AxisView faulty = axisView("x");
  faulty.fault = "it stopped at 0.02 m";
  Session session = sessionWith({faulty});
  session.answered({Call::What::kGoTo, "x"}, false, "x: the position 0.3 m is above 0.2 m");
  EXPECT_TRUE(said(session, "x: go to REFUSED: x: the position 300.0000 mm is above 200.0000 mm"));
  session.logged("x: it stands at the soft limit 0.2 m");
  EXPECT_TRUE(said(session, "x: it stands at the soft limit 200.0000 mm"));
  EXPECT_EQ(session.driver().axis("x")->fault, "it stopped at 20.0000 mm");
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
