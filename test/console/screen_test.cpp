#include "screen.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "support/axes.h"
#include "wrapped.h"

namespace stepdriver::console {
namespace {

std::string screenText(const Session& session, int rows, int columns, double now = 0.0) {
  std::string text;
  for (const Row& row : draw(session, rows, columns, now)) text += row.text + "\n";
  return text;
}

testing::AssertionResult shows(const std::string& screen, const std::string& words) {
  if (screen.find(words) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "\"" << words << "\" isn't on\n" << screen;
}

std::vector<AxisView> sixAxes() {
  std::vector<AxisView> axes;
  for (const char* name : {"x", "y", "z", "a", "b", "c"}) {
    axes.push_back(axisView(name));
    axes.back().position = -170.0;
    axes.back().velocity = -100.0;
    axes.back().moving = true;
  }
  return axes;
}

TEST(Screen, ShowsEachAxisInMmWithItsSwitchesAndStates) {
  AxisView x = axisView("x");
  x.position = 12.3456;
  x.velocity = -3.5;
  x.moving = true;
  x.homed = true;
  x.max_active = true;
  const std::string screen = screenText(sessionWith({x}), 24, 80);
  for (const char* words :
       {"> x", "12.3456 mm", "-3.50 mm/s", "open    PRESSED", "on", "moving homed"}) {
    EXPECT_TRUE(shows(screen, words));
  }
  EXPECT_TRUE(shows(screen, "live"));
}

TEST(Screen, ShowsThatTheMotorPowerIsOff) {
  AxisView x = axisView("x");
  EXPECT_FALSE(shows(screenText(sessionWith({x}), 24, 80), "no power"));
  x.powered = false;
  EXPECT_TRUE(shows(screenText(sessionWith({x}), 24, 80), "no power"));
}

TEST(Screen, EverythingOfSixAxesFitsIntoTheSmallestUsualWindow) {
  Session session = sessionWith(sixAxes());
  const std::string screen = screenText(session, 24, 80);
  for (const char* words : {"> x", "  c ", "speed", "min end", "max end", "moving unverified",
                            "SPACE EMERGENCY STOP", "home all"}) {
    EXPECT_TRUE(shows(screen, words));
  }
  EXPECT_EQ(screen.find("too narrow"), std::string::npos) << screen;
}

TEST(Screen, FillsTheWindowAndNeverMore) {
  Session session = sessionWith(sixAxes());
  session.messages().say(
      "a refusal that is so long that it can't be shown in one row of any window");
  session.press({' ', '?'}, 0.0);
  session.emergencyAnswered(true, "");
  AxisView faulty = axisView("x");
  faulty.fault = "the chip reports over-current or over-temperature";
  session.update({faulty, axisView("y")}, 0.0);
  for (int rows = 1; rows < 60; ++rows) {
    for (int columns = 1; columns < 140; columns += 3) {
      const std::vector<Row> screen = draw(session, rows, columns, 0.0);
      ASSERT_EQ(static_cast<int>(screen.size()), rows) << columns;
      for (const Row& row : screen) ASSERT_LE(static_cast<int>(row.text.size()), columns);
    }
  }
}

TEST(Screen, ShowsOutputsAndInputsWithTheAgeOfTheirStates) {
  Session session = sessionWith({axisView("x")});
  EXPECT_EQ(screenText(session, 24, 80).find("outputs"), std::string::npos);
  EXPECT_EQ(screenText(session, 24, 80).find("t switch"), std::string::npos);
  session.driver().updateIo({{"lamp", false, {}, "", ""}, {"pen", true, -3.5, "", ""}},
                            {{"paper", true, -130.0, ""}});
  const std::string screen = screenText(session, 24, 80);
  for (const char* words : {"outputs    > lamp: off since the start    pen: on 3 s",
                            "inputs    paper: active 2 min", "n next output", "t switch lamp"}) {
    EXPECT_TRUE(shows(screen, words));
  }
  EXPECT_TRUE(shows(screenText(session, 24, 80, 2.0), "pen: [on 5 s]")) << "its state is old";
  session.driver().updateIo({{"pen", false, 0.0, "it was on for 600 s, its max_on_s", "I/O error"}},
                            {{"paper", true, {}, "the chip is gone"}});
  const std::string wrong = screenText(session, 24, 80);
  for (const char* words : {"pen: it was on for 600 s, its max_on_s", "OUTPUT pen: I/O error",
                            "INPUT paper: the chip is gone"}) {
    EXPECT_TRUE(shows(wrong, words));
  }
}

TEST(Screen, ShowsTheValueOfAPwmOutput) {
  Session session = sessionWith({axisView("x")});
  OutputView laser{"laser", true, -3.5, "", ""};
  // As a part of 65535.
  for (const auto& [value, words] :
       {std::pair{16384.0 / 65535.0, "> laser: on at 0.25 3 s"},
        std::pair{1.0 / 65535.0, "> laser: on at 1.53e-05 3 s"},
        std::pair{65534.0 / 65535.0, "> laser: on 3 s"}, std::pair{1.0, "> laser: on 3 s"}}) {
    laser.value = value;
    session.driver().updateIo({laser}, {});
    EXPECT_TRUE(shows(screenText(session, 24, 80), words));
  }
  laser.on = false;
  laser.value = 0.0;
  session.driver().updateIo({laser}, {});
  EXPECT_TRUE(shows(screenText(session, 24, 80), "> laser: off 3 s"));
}

TEST(Screen, ShowsWhatAPositionMakesOfAnOutput) {
  Session session = sessionWith({axisView("x")});
  session.driver().updateIo({{"camera", false, -3.0, "", "", "x", 41, 2}}, {});
  const std::string screen = screenText(session, 24, 80);
  for (const char* words :
       {"> camera: off 3 s, by x: 41 made, 2 missed", "u no longer by position: camera"}) {
    EXPECT_TRUE(shows(screen, words));
  }
  EXPECT_FALSE(shows(screen, "t switch camera"));
}

TEST(Screen, SaysWhatASmallWindowCannotShow) {
  Session session = sessionWith(sixAxes());
  session.press({'6'}, 0.0);
  const std::string low = screenText(session, 6, 80);
  EXPECT_TRUE(shows(low, "of 6; up, down: the others"));
  EXPECT_TRUE(shows(low, "> c")) << "the chosen one is always there";
  EXPECT_TRUE(shows(low, "SPACE EMERGENCY STOP"));
  const std::string narrow = screenText(session, 24, 40);
  EXPECT_TRUE(shows(narrow, "too narrow to show: speed"));
  EXPECT_TRUE(shows(narrow, "-170.0000 mm"));
}

TEST(Screen, StaleValuesAreShownAsStale) {
  AxisView x = axisView("x");
  x.position = 7.0;
  const Session session = sessionWith({x});
  EXPECT_FALSE(shows(screenText(session, 24, 80, 0.9), "STALE"));
  const std::string screen = screenText(session, 24, 80, 3.5);
  EXPECT_TRUE(shows(screen, "NO STATE FOR 3.5 s"));
  EXPECT_TRUE(shows(screen, "(7.0000 mm)"));
  EXPECT_TRUE(shows(screen, "(open)"));
  EXPECT_TRUE(shows(screen, "STALE"));
  EXPECT_EQ(screen.find(" live"), std::string::npos);
  EXPECT_TRUE(shows(screenText(Session("/stepdriver", {}), 24, 80), "NO STATE YET"));
}

TEST(Screen, SwitchesThatAreNotKnownAreNotShownAsOpen) {
  Session session = sessionWith({axisView("x")});
  session.driver().forgetEvents();
  const std::string screen = screenText(session, 24, 80);
  EXPECT_FALSE(shows(screen, "open"));
  EXPECT_TRUE(shows(screen, "mm/s ?       ?"));
}

TEST(Screen, ShowsTheDriverOfTheChosenAxis) {
  Session session = sessionWith({axisView("x"), axisView("y")});
  session.driver().updateChips("x", "0.80 A of 0.80 A, below 120 C, load 20 %");
  EXPECT_TRUE(shows(screenText(session, 24, 80), "driver: 0.80 A of 0.80 A, below 120 C, load"));
  session.press({'2'}, 0.0);
  EXPECT_FALSE(shows(screenText(session, 24, 80), "driver:"));
  session.press({'1'}, 0.0);
  session.driver().forgetEvents();
  EXPECT_FALSE(shows(screenText(session, 24, 80), "driver:"));
}

TEST(Screen, SaysLoudlyThatAnEmergencyStopWasMadeAndWhatEndsIt) {
  Session session = sessionWith({axisView("x")});
  session.press({' '}, 0.0);
  EXPECT_TRUE(
      shows(screenText(session, 24, 80, 2.0), "EMERGENCY STOP sent 2.0 s ago, NO ANSWER YET"));
  session.emergencyAnswered(true, "");
  const std::vector<Row> screen = draw(session, 24, 80, 0.0);
  EXPECT_TRUE(screen[0].loud);
  EXPECT_TRUE(shows(screen[0].text, "*** EMERGENCY STOP: the driver has stopped every axis"));
  EXPECT_TRUE(shows(screenText(session, 24, 80), "r recovers"));
  session.press({' '}, 0.0);
  session.emergencyAnswered(false, "nobody answers");
  EXPECT_TRUE(shows(screenText(session, 24, 80),
                    "EMERGENCY STOP FAILED: nobody answers. CUT THE POWER BY HAND"));
}

TEST(Screen, ShowsFaultsAndRefusalsInTheirWords) {
  AxisView x = axisView("x");
  x.fault = "a pulse was 7 ms late";
  Session session = sessionWith({x});
  session.answered({Call::What::kEnable, "x"}, false, "x: at fault: a pulse was 7 ms late");
  const std::string screen = screenText(session, 24, 80);
  EXPECT_TRUE(shows(screen, "FAULT x: a pulse was 7 ms late"));
  EXPECT_TRUE(shows(screen, "x: enable REFUSED: x: at fault: a pulse was 7 ms late"));
}

std::vector<AxisView> nineAxesWithLongNames() {
  std::vector<AxisView> axes;
  for (int i = 1; i <= 9; ++i) {
    axes.push_back(axisView("gantry_carriage_drive_number_" + std::to_string(i)));
    axes.back().position = -1234.5678;
    axes.back().velocity = -100.0;
    axes.back().moving = true;
  }
  return axes;
}

TEST(Screen, NineAxesWithLongNamesFitIntoNarrowWindows) {
  for (const int columns : {80, 60}) {
    Session session = sessionWith(nineAxesWithLongNames());
    session.press({'9', 'g', '1', '2'}, 0.0);
    session.logged(
        "gantry_carriage_drive_number_9: the position 1.25 m is above the soft limit "
        "max_position 0.2 m, from the configuration");
    const std::vector<Row> screen = draw(session, 36, columns, 0.0);
    ASSERT_EQ(screen.size(), 36U);
    for (const Row& row : screen) EXPECT_LE(static_cast<int>(row.text.size()), columns) << row.text;
    const std::string text = screenText(session, 36, columns);
    for (const char* words :
         {"> gantry~ber_9", "  gantry~ber_1", "-1234.5678 mm", "moving",
          "Move gantry~ber_9 to [mm]: 12_", "max_position 200.0000 mm", "SPACE EMERGENCY STOP"}) {
      EXPECT_TRUE(shows(text, words)) << columns;
    }
  }
}

TEST(Screen, ANameIsShownWholeIfThereIsRoom) {
  const Session session = sessionWith({axisView("gantry_carriage")});
  EXPECT_TRUE(shows(screenText(session, 24, 100), "> gantry_carriage "));
  EXPECT_TRUE(shows(screenText(session, 24, 60), "> gantry~riage "));
}

TEST(Screen, AHelpThatDoesNotFitIsCutAndSaysSo) {
  Session session = sessionWith(sixAxes());
  session.press({'?'}, 0.0);
  EXPECT_TRUE(shows(screenText(session, 24, 80), "r ends faults"));
  EXPECT_FALSE(shows(screenText(session, 24, 80), "more keys in a larger window"));
  const std::string small = screenText(session, 20, 60);
  EXPECT_TRUE(shows(small, "up down 1-9"));
  EXPECT_TRUE(shows(small, "more keys in a larger window"));
}

TEST(Screen, ShowsTheStepSizeTheOverrideAndWhatIsTyped) {
  Session session = sessionWith({axisView("x")});
  EXPECT_TRUE(
      shows(screenText(session, 24, 80), "- + steps: one motor step    speed override: 100 %"));
  session.press({'i'}, 0.0);
  session.answered(session.press({'['}, 0.0).calls.at(0), true, "");
  EXPECT_TRUE(shows(screenText(session, 24, 80), "- + steps: 0.1 mm    speed override: 90 %"));
  session.press({'g', '-', '7'}, 0.0);
  EXPECT_TRUE(shows(screenText(session, 24, 80), "Move x to [mm]: -7_"));
  EXPECT_TRUE(shows(screenText(session, 6, 40), "Move x to [mm]: -7_")) << "also in a small window";
  session.press({'s'}, 0.0);
  EXPECT_TRUE(shows(screenText(session, 24, 80),
                    "x isn't moved: keys do nothing until Enter or Esc (s, SPACE stop)"));
  session.press({kKeyEscape, 'z'}, 0.0);
  EXPECT_TRUE(shows(screenText(session, 24, 80), "Set the position of x to 0?"));
}

TEST(Screen, TheHelpListsEveryKey) {
  Session session = sessionWith({axisView("x")});
  session.press({'?'}, 0.0);
  const std::string screen = screenText(session, 40, 80);
  for (const char* words : {"up down 1-9",
                            "e enable x",
                            "d disable x",
                            "left right",
                            "shift+left",
                            "< >",
                            "- +",
                            "i step size",
                            "g go to a position",
                            "z set zero",
                            "h home x",
                            "a home all",
                            "p hold",
                            "c resume",
                            "[ ] speed",
                            "r recover",
                            ", . jog slowly too",
                            "k j tab",
                            "= one step",
                            "SPACE EMERGENCY STOP",
                            "s stop all axes",
                            "Esc",
                            "q quit",
                            "? all keys"}) {
    EXPECT_TRUE(shows(screen, words));
  }
}

TEST(Screen, ARotaryAxisIsInDegrees) {
  Session session = sessionWith({axisView("x")});
  config::AxisConfig config = axisConfig("x");
  config.kind = config::Kind::kRotary;
  session.driver().configure({config});
  EXPECT_TRUE(shows(screenText(session, 24, 80), "0.0000 deg"));
}

TEST(Wrapped, CutsBetweenWordsAndKeepsThemAll) {
  EXPECT_EQ(wrapped("one two three", 8), (std::vector<std::string>{"one two", "three"}));
  EXPECT_EQ(wrapped("abcdefghij", 4), (std::vector<std::string>{"abcd", "efgh", "ij"}));
  EXPECT_EQ(wrapped("m\xc2\xb5\n", 8), (std::vector<std::string>{"m?? "}));
}

}  // namespace
}  // namespace stepdriver::console
