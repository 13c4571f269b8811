#include "table_units.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>

namespace stepdriver::console {
namespace {

TEST(TableUnits, ConvertTheNumbersOfTheDriversTexts) {
  for (const auto& [text, wanted] : {
           std::pair<std::string, std::string>{"x reached 0.02 m", "x reached 20.0000 mm"},
           {"x is homed, and stands at -0.0105 m", "x is homed, and stands at -10.5000 mm"},
           {"r stands at 1.5707963 rad, not at 3.1415927 rad: stopped",
            "r stands at 90.0000 deg, not at 180.0000 deg: stopped"},
           {"the velocity 0.2 m/s is above the maximum 0.1 m/s, from the configuration",
            "the velocity 200 mm/s is above the maximum 100 mm/s, from the configuration"},
           {"the jerk 2 m/s^3 is above 1e-05 m/s^3", "the jerk 2000 mm/s^3 is above 0.01 mm/s^3"},
           {"0.1 m", "100.0000 mm"},
           {"from 0.1 m,0.2 m", "from 100.0000 mm,200.0000 mm"},
       }) {
    EXPECT_EQ(inTableUnits(text), wanted);
  }
}

TEST(TableUnits, LeaveEverythingElseAsItIs) {
  for (const std::string text :
       {"a pulse was 7 ms late", "x moves to 20.0000 mm in 1.2 s", "line_1 m", "80000 steps/m",
        "after 3 more tries", "5 microsteps", "x2 moves", ""}) {
    EXPECT_EQ(inTableUnits(text), text);
  }
}

TEST(TableUnits, AMoveIsToldByItsNumbers) {
  const TableUnits mm{1000.0, "mm"};
  EXPECT_EQ(moveText("x", mm, 0.02, 0.02, 1.25), "x moves to 20.0000 mm in 1.25 s");
  EXPECT_EQ(moveText("x", mm, 0.02, 0.02, 0.0447214), "x moves to 20.0000 mm in 0.04 s");
  EXPECT_EQ(moveText("x", mm, 0.02, 0.02, 0.0), "x is already at 20.0000 mm");
  EXPECT_EQ(moveText("x", mm, 0.00001, 0.0000125, 1.0),
            "x moves to 0.0100 mm in 1 s; it comes to rest at 0.0125 mm, the nearest microstep");
}

TEST(TableUnits, ZeroHasNoSign) { EXPECT_EQ(positionText(-1e-9, "mm"), "0.0000 mm"); }

}  // namespace
}  // namespace stepdriver::console
