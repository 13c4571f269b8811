#include "table_units.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <fstream>
#include <string>

namespace stepdriver::console {
namespace {

// The panel's texts are tested with the same table: test/panel/units_test.py.
TEST(TableUnits, ConvertTheNumbersOfTheDriversTextsAndNothingElse) {
  std::ifstream table(STEPDRIVER_SOURCES "/test/console/table_units.txt");
  int cases = 0;
  for (std::string line; std::getline(table, line);) {
    if (line.empty() || line.front() == '#') continue;
    const std::size_t arrow = line.find(" => ");
    ASSERT_NE(arrow, std::string::npos) << line;
    EXPECT_EQ(inTableUnits(line.substr(0, arrow)), line.substr(arrow + 4));
    ++cases;
  }
  EXPECT_GE(cases, 15);
  EXPECT_EQ(inTableUnits(""), "");
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
