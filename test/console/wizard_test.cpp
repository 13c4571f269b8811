#include <gtest/gtest.h>

#include <deque>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "support/axes.h"
#include "wizard/axis_bring_up.h"
#include "wizard/bring_up_checks.h"
#include "wizard/hand_move.h"

namespace stepdriver::console {
namespace {

/// A person who answers each question in turn, and acts when nothing is asked.
class Person : public Dialogue {
 public:
  explicit Person(std::deque<std::string> answers) : answers_(std::move(answers)) {}

  void say(const std::string& text) override {
    heard += text + "\n";
    if (on_say) on_say(text);
  }
  std::string ask(const std::string& question) override {
    heard += question + "\n";
    if (answers_.empty()) throw Ended("no answer to: " + question);
    std::string answer = answers_.front();
    answers_.pop_front();
    return answer;
  }
  std::optional<std::string> line() override {
    if (patience-- > 0) return {};
    return "";
  }
  std::optional<std::string> lineOfAHand() override {
    if (!stops_moves) return {};
    return "";
  }

  bool heardOf(const std::string& words) const { return heard.find(words) != std::string::npos; }

  std::string heard;
  std::function<void(const std::string&)> on_say;
  int patience = 1000;  ///< how often it looks before it presses Enter if it may press a switch
  bool stops_moves = false;

 private:
  std::deque<std::string> answers_;
};

/// An axis that does at once what it is told, with switches that a hand presses.
class Machine : public MachineAtHand {
 public:
  void wait() override {
    ++states_;
    if (on_wait) on_wait();
  }
  int states() const override { return states_; }
  AxisView state(const std::string& /*axis*/) override {
    if (gone) throw Error("no state comes any more");
    return view;
  }
  client::Answer enable(const std::string& /*axis*/, bool on) override {
    view.enabled = on;
    return {true, ""};
  }
  client::Answer setPosition(const std::string& /*axis*/, double position) override {
    view.position = position;
    view.position_valid = true;
    return {true, "x: stands there"};
  }
  client::Answer move(const std::string& /*axis*/, double distance, double speed) override {
    moves.push_back(distance);
    speeds.push_back(speed);
    if (!refusal.empty()) return {false, refusal};
    view.position += distance;
    view.moving = endless;
    return {true, ""};
  }
  client::Answer stop(const std::string& /*axis*/) override {
    ++stops;
    view.moving = false;
    return {true, ""};
  }

  AxisView view = axisView("x");
  std::vector<double> moves;
  std::vector<double> speeds;
  std::function<void()> on_wait;
  std::string refusal;
  bool endless = false;  ///< moves continue until they are stopped
  bool gone = false;
  int stops = 0;

 private:
  int states_ = 0;
};

/// Presses a switch whenever the wizard asks for that end, and lets it go.
void handle(Person& person, Machine& machine, bool AxisView::*minus, bool AxisView::*plus) {
  person.on_say = [&machine, minus, plus](const std::string& text) {
    if (text.find("has changed; release it") != std::string::npos) {
      machine.view.min_active = machine.view.max_active = false;
    }
    for (const auto& [end, pressed] : {std::pair{"minus", minus}, std::pair{"plus", plus}}) {
      if (text.find(std::string("Press the switch at the ") + end) == std::string::npos) continue;
      // It is still open when the wizard looks for the first time.
      machine.on_wait = [&machine, pressed = pressed] {
        if (pressed != nullptr) machine.view.*pressed = true;
        machine.on_wait = nullptr;
      };
    }
  };
}

Findings switchesFound(Person& person, Machine& machine) {
  Findings findings;
  checkSwitches(person, machine, axisConfig("x"), findings);
  return findings;
}

TEST(WizardSwitches, RightOnesChangeNothing) {
  Person person({});
  Machine machine;
  handle(person, machine, &AxisView::min_active, &AxisView::max_active);
  const Findings findings = switchesFound(person, machine);
  EXPECT_TRUE(changesText(findings, axisConfig("x")).empty()) << person.heard;
  EXPECT_FALSE(person.heardOf("ATTENTION")) << person.heard;
  EXPECT_TRUE(machine.moves.empty());
}

TEST(WizardSwitches, FindsThemSwapped) {
  Person person({});
  Machine machine;
  handle(person, machine, &AxisView::max_active, &AxisView::min_active);
  const Findings findings = switchesFound(person, machine);
  EXPECT_TRUE(findings.switches_swapped) << person.heard;
  EXPECT_FALSE(findings.min_inverted || findings.max_inverted) << person.heard;
}

TEST(WizardSwitches, FindsOneInverted) {
  Person person({});
  Machine machine;
  machine.view.max_active = true;
  person.on_say = [&machine](const std::string& text) {
    const auto says = [&](const char* words) { return text.find(words) != std::string::npos; };
    if (says("the minus end by hand")) machine.on_wait = [&] { machine.view.min_active = true; };
    if (says("the plus end by hand")) machine.on_wait = [&] { machine.view.max_active = false; };
    if (!says("has changed; release it")) return;
    machine.on_wait = nullptr;
    machine.view.min_active = false;
    machine.view.max_active = true;
  };
  const Findings findings = switchesFound(person, machine);
  EXPECT_TRUE(findings.max_inverted) << person.heard;
  EXPECT_FALSE(findings.min_inverted || findings.switches_swapped) << person.heard;
}

TEST(WizardSwitches, SaysWhichOneIsDead) {
  Person person({});
  Machine machine;
  handle(person, machine, &AxisView::min_active, nullptr);
  const Findings findings = switchesFound(person, machine);
  EXPECT_TRUE(changesText(findings, axisConfig("x")).empty()) << person.heard;
  EXPECT_TRUE(person.heardOf("ATTENTION: endstops/max")) << person.heard;
  EXPECT_FALSE(person.heardOf("ATTENTION: endstops/min")) << person.heard;
}

TEST(WizardSwitches, SaysWhereBothEndsAreOneLine) {
  Person person({});
  Machine machine;
  handle(person, machine, &AxisView::min_active, &AxisView::min_active);
  EXPECT_FALSE(switchesFound(person, machine).switches_swapped) << person.heard;
  EXPECT_TRUE(person.heardOf("wired together")) << person.heard;
}

TEST(WizardMoves, NothingMovesWithoutAYes) {
  Person person({"", "n", "", "n"});
  Machine machine;
  Findings findings;
  checkDirection(person, machine, axisConfig("x"), findings);
  EXPECT_TRUE(machine.moves.empty());
  EXPECT_FALSE(findings.wrong_way);
}

TEST(WizardMoves, AreSmallAndSlow) {
  Person person({"y", "+"});
  Machine machine;
  Findings findings;
  checkDirection(person, machine, axisConfig("x"), findings);
  EXPECT_EQ(machine.moves, std::vector<double>{2.0});
  EXPECT_EQ(machine.speeds, std::vector<double>{5.0});
  config::AxisConfig slow = axisConfig("x");
  slow.max_speed = 0.004;
  EXPECT_EQ(visibleMove(slow).speed, 2.0) << "half of its highest";
}

TEST(WizardMoves, AWrongWayIsFoundWhicheverWayItWent) {
  Machine machine;
  Person person({"y", "-", "y"});
  Findings findings;
  checkDirection(person, machine, axisConfig("x"), findings);
  EXPECT_TRUE(findings.wrong_way);

  machine.refusal = "x: the max endstop is active";
  Person other({"y", "y", "y", "+", "y"});
  Findings back;
  other.on_say = [&](const std::string& text) {
    if (text.find("The driver refuses: x: the max endstop is active") != std::string::npos) {
      machine.refusal.clear();
    }
  };
  checkDirection(other, machine, axisConfig("x"), back);
  EXPECT_EQ(machine.moves.back(), -2.0) << other.heard;
  EXPECT_TRUE(back.wrong_way) << other.heard;
}

TEST(WizardMoves, TheDirectionIsToldByTheEndThatTheUserSaw) {
  struct Wanted {
    bool plus_blocked;
    std::deque<std::string> answers;
    bool wrong_way;
  };
  for (const Wanted& wanted : {Wanted{false, {"y", "+"}, false},
                               {false, {"y", "-", "y"}, true},
                               {true, {"y", "-"}, false},
                               {true, {"y", "+", "y"}, true},
                               {false, {"y", "-", "n", "y", "+"}, false},
                               {false, {"y", "a", "y", "plus"}, false},
                               {false, {"y", "y", "", "minus", "y"}, true}}) {
    Machine machine;
    machine.view.switches_known = true;
    machine.view.max_active = wanted.plus_blocked;
    Person person(wanted.answers);
    Findings findings;
    checkDirection(person, machine, axisConfig("x"), findings);
    EXPECT_EQ(findings.wrong_way, wanted.wrong_way) << person.heard;
    EXPECT_EQ(machine.moves.front(), wanted.plus_blocked ? -2.0 : 2.0) << person.heard;
    EXPECT_TRUE(person.heardOf("Which way did x move? [+ plus end, - minus end, a again]"))
        << person.heard;
  }
}

TEST(WizardMoves, ARotaryAxisTurns) {
  config::AxisConfig config = axisConfig("r");
  config.kind = config::Kind::kRotary;
  Machine machine;
  Person person({"y", "+"});
  Findings findings;
  checkDirection(person, machine, config, findings);
  EXPECT_TRUE(person.heardOf("Which way did r turn? [+ plus, - minus, a again]")) << person.heard;
}

TEST(WizardMoves, TheReasonsToRefuseAMoveAreKnown) {
  config::AxisConfig config = axisConfig("x");
  config.min_position = 0.0;
  config.max_position = 0.2;
  AxisView there = axisView("x");
  there.switches_known = true;
  there.position = 100.0;
  EXPECT_EQ(knownRefusal(config, there, 2.0), "");
  EXPECT_EQ(knownRefusal(config, there, 100.0), "") << "the limit itself can be reached";
  EXPECT_EQ(knownRefusal(config, there, 101.0),
            "it stands at 100.0000 mm, and would then be beyond its soft limit 200.0000 mm");
  EXPECT_EQ(knownRefusal(config, there, -101.0),
            "it stands at 100.0000 mm, and would then be beyond its soft limit 0.0000 mm");
  const auto with = [&](auto change) {
    AxisView view = there;
    change(view);
    return view;
  };
  EXPECT_EQ(knownRefusal(config, with([](AxisView& view) { view.min_active = true; }), -2.0),
            "the min switch ahead of it reads pressed");
  EXPECT_EQ(knownRefusal(config, with([](AxisView& view) { view.min_active = true; }), 2.0), "");
  EXPECT_EQ(knownRefusal(config, with([](AxisView& view) { view.max_active = true; }), 2.0),
            "the max switch ahead of it reads pressed");
  EXPECT_EQ(knownRefusal(config, with([](AxisView& view) { view.enabled = false; }), 2.0),
            "its motor is disabled");
  EXPECT_EQ(knownRefusal(config, with([](AxisView& view) {
                           view.enabled = false;
                           view.idle = true;
                         }),
                         2.0),
            "")
      << "a motion wakes it up";
  EXPECT_EQ(knownRefusal(config, with([](AxisView& view) { view.asleep = true; }), 2.0),
            "its driver chip is asleep");
  EXPECT_EQ(knownRefusal(config, with([](AxisView& view) { view.held = true; }), 2.0),
            "it is on hold");
  EXPECT_EQ(knownRefusal(config, with([](AxisView& view) { view.fault = "hot"; }), 2.0),
            "it has a fault: hot");
}

TEST(WizardMoves, AMoveThatWouldBeRefusedIsNotOffered) {
  Machine machine;
  machine.view.switches_known = true;
  machine.view.min_active = machine.view.max_active = true;
  Person person({});
  Findings findings;
  checkDirection(person, machine, axisConfig("x"), findings);
  EXPECT_TRUE(machine.moves.empty()) << person.heard;
  EXPECT_FALSE(person.heardOf("Move x now?")) << person.heard;
  EXPECT_TRUE(person.heardOf("x can't move 2 mm towards plus: the max switch")) << person.heard;
  EXPECT_TRUE(person.heardOf("towards minus either: the min switch")) << person.heard;
  EXPECT_TRUE(person.heardOf("The direction isn't checked.")) << person.heard;

  Person at_hand({"y"});
  machine.view.fault = "emergency stop";
  EXPECT_EQ(HandMove(at_hand, machine, axisConfig("x")).ask({2.0, 5.0}), 0.0);
  EXPECT_TRUE(machine.moves.empty()) << at_hand.heard;
}

TEST(WizardDistance, OffersOnlyTheWayThatHasRoom) {
  config::AxisConfig config = axisConfig("x");
  config.min_position = 0.0;
  config.max_position = 0.2;
  Machine machine;
  machine.view.position = 190.0;
  Person person({"", "", "y", "", "y", "20"});
  Findings findings;
  checkDistance(person, machine, config, findings);
  EXPECT_EQ(machine.moves, (std::vector<double>{-2.0, -20.0})) << person.heard;
  EXPECT_TRUE(person.heardOf("x can't move 22 mm towards plus: it stands at 190.0000 mm"));
  EXPECT_TRUE(
      person.heardOf("Is there room for 22 mm towards your minus end: 2 mm to take up "
                     "the play, then 20 mm?"))
      << person.heard;

  Person far({"300", "n"});
  checkDistance(far, machine, config, findings);
  EXPECT_EQ(machine.moves.size(), 2U) << far.heard;
  EXPECT_TRUE(far.heardOf("x can't move 302 mm towards minus: it stands at 168.0000 mm"))
      << far.heard;
}

TEST(WizardMoves, AreStoppedByEnterAndByASwitch) {
  Machine machine;
  machine.endless = true;
  Person hand({"y"});
  hand.stops_moves = true;
  const config::AxisConfig config = axisConfig("x");
  EXPECT_EQ(HandMove(hand, machine, config).ask({2.0, 5.0}), 0.0);
  EXPECT_EQ(machine.stops, 1);

  Person person({"y"});
  machine.on_wait = [&] { machine.view.min_active = machine.moves.size() == 2; };
  EXPECT_EQ(HandMove(person, machine, config).ask({2.0, 5.0}), 0.0);
  EXPECT_EQ(machine.stops, 2);
  EXPECT_TRUE(person.heardOf("Stopped: a switch has changed")) << person.heard;
}

TEST(WizardMoves, AStopIsSentWhereTheDialogueEndsOrTheDriverGoes) {
  Machine machine;
  machine.endless = true;
  machine.on_wait = [&] { machine.gone = !machine.moves.empty(); };
  Person person({"y"});
  const config::AxisConfig config = axisConfig("x");
  EXPECT_THROW(HandMove(person, machine, config).ask({2.0, 5.0}), Error);
  EXPECT_EQ(machine.stops, 1);
}

TEST(WizardDistance, ScalesByCommandedOverMeasured) {
  Machine machine;
  Person person({"", "", "y", "", "y", "25", "y"});
  Findings findings;
  checkDistance(person, machine, axisConfig("x"), findings);
  EXPECT_EQ(machine.moves, (std::vector<double>{2.0, 20.0})) << person.heard;
  ASSERT_TRUE(findings.scale) << person.heard;
  EXPECT_NEAR(*findings.scale, 0.8, 1e-12);
  EXPECT_TRUE(person.heardOf("80 x 20 / 25 = 64 steps per mm")) << person.heard;
}

TEST(WizardDistance, IsTriedAgainWhereAMoveIsRefused) {
  Machine machine;
  machine.refusal = "x: the target is beyond the soft limit";
  Person person({"", "y", "y", "y", "", "n", "y", "", "y", "25", "y"});
  person.on_say = [&](const std::string& text) {
    if (text.find("beyond the soft limit") != std::string::npos) machine.refusal.clear();
  };
  Findings findings;
  findings.wrong_way = true;
  checkDistance(person, machine, axisConfig("x"), findings);
  EXPECT_EQ(machine.moves, (std::vector<double>{2.0, -2.0, -20.0})) << person.heard;
  EXPECT_TRUE(findings.scale) << person.heard;
  EXPECT_TRUE(person.heardOf("its plus is your minus")) << person.heard;
  EXPECT_TRUE(
      person.heardOf("Is there room for 22 mm towards your minus end: 2 mm to take up "
                     "the play, then 20 mm?"))
      << person.heard;
  EXPECT_TRUE(person.heardOf("If you answer n, it moves towards your plus end.")) << person.heard;
}

TEST(WizardDistance, KnowsTheMicrostepsByTheirFactor) {
  Machine machine;
  Person person({"30", "n", "y", "", "y", "60 mm", "n"});
  Findings findings;
  checkDistance(person, machine, axisConfig("x"), findings);
  EXPECT_EQ(machine.moves, (std::vector<double>{-2.0, -30.0})) << person.heard;
  EXPECT_FALSE(findings.scale) << "it wasn't taken";
  EXPECT_TRUE(person.heardOf("near a factor of 2: first compare the microsteps")) << person.heard;
}

TEST(WizardDistance, LeavesWhatIsAsGoodAsRight) {
  Machine machine;
  Person person({"", "", "y", "", "y", "20.03"});
  Findings findings;
  checkDistance(person, machine, axisConfig("x"), findings);
  EXPECT_FALSE(findings.scale) << person.heard;
}

TEST(WizardAnswers, AreAskedAgainUntilTheyAreUnderstood) {
  Person person({"maybe", "-3", "3 inch", "12.5"});
  EXPECT_EQ(askLength(person, "How far?", "mm"), 12.5);
  EXPECT_TRUE(person.heardOf("\"maybe\" isn't understood: it must be a number, in mm"));
  EXPECT_TRUE(person.heardOf("-3 mm is no length: it must be above 0"));
}

TEST(WizardAxis, HasCurrentAfterwardsOnlyWhereItHadItBefore) {
  config::AxisConfig config = axisConfig("x");
  config.endstop_min.reset();
  config.endstop_max.reset();
  Machine machine;
  machine.view.enabled = false;
  Person no({"n"});
  bringUp(no, machine, config);
  EXPECT_FALSE(machine.view.enabled);
  EXPECT_TRUE(machine.moves.empty());

  Person yes({"y", "-7.5", "y"});  // and leaves at the next question
  EXPECT_THROW(bringUp(yes, machine, config), Ended);
  EXPECT_EQ(machine.moves.size(), 1U);
  EXPECT_EQ(machine.view.position, -5.5);
  EXPECT_FALSE(machine.view.enabled);
}

}  // namespace
}  // namespace stepdriver::console
