#include <gtest/gtest.h>

#include "stepdriver_core/setup/machine_config.h"
#include "support/axis_config.h"

namespace stepdriver::config {
namespace {

ConfigValue shaper(const std::string& type, ConfigValue frequency) {
  return mapOf({{"type", type}, {"frequency", std::move(frequency)}});
}

ConfigValue axisWith(ConfigValue input_shaper) {
  ConfigValue axis = linearAxis();
  put(axis, "input_shaper", std::move(input_shaper));
  return axis;
}

// With another damping than the shaper expects, a spring of the rig would ring although only the
// frequency was given, and it is right.
TEST(ReadShaper, ExpectsTheDampingOfASpringOfTheRig) {
  EXPECT_EQ(ShaperConfig{}.damping, setup::SimulatedAxis{}.spring_damping);
}

TEST(ReadShaper, ReadsOneOrAList) {
  EXPECT_TRUE(readX(linearAxis()).input_shaper.empty());
  ConfigValue axis = axisWith(shaper("mzv", 42));
  ASSERT_EQ(readX(axis).input_shaper.size(), 1U);
  EXPECT_EQ(readX(axis).input_shaper[0].type, ShaperType::kMzv);
  EXPECT_EQ(readX(axis).input_shaper[0].frequency, 42.0);
  EXPECT_EQ(readX(axis).input_shaper[0].damping, 0.1);
  put(axis, "input_shaper/damping", 0.03);
  put(axis, "input_shaper/type", "2hump_ei");
  put(axis, "input_shaper/frequency", ConfigValue::List{30.5, 71});
  const auto both = readX(axis).input_shaper;
  ASSERT_EQ(both.size(), 2U);
  EXPECT_EQ(both[0].frequency, 30.5);
  EXPECT_EQ(both[1].frequency, 71.0);
  EXPECT_EQ(both[1].type, ShaperType::kTwoHumpEi);
  EXPECT_EQ(both[1].damping, 0.03);
  const auto list = readX(axisWith(ConfigValue::List{shaper("zv", 30), shaper("ei", 71.0)}));
  ASSERT_EQ(list.input_shaper.size(), 2U);
  EXPECT_EQ(list.input_shaper[0].type, ShaperType::kZv);
  EXPECT_EQ(list.input_shaper[1].type, ShaperType::kEi);
}

TEST(ReadShaper, RefusesWhatIsNoShaper) {
  EXPECT_EQ(issuesOfX(axisWith("mzv")),
            lineOfX("input_shaper",
                    "is \"mzv\", but must be a map with type and frequency, or a "
                    "list of such maps"));
  EXPECT_EQ(issuesOfX(axisWith(ConfigValue::List{})),
            lineOfX("input_shaper", "is empty, but must have a map with type and frequency"));
  EXPECT_EQ(issuesOfX(axisWith(ConfigValue::List{shaper("zv", 0.0)})),
            lineOfX("input_shaper[0]/frequency", "is 0.0, but must be from 0.5 to 1000"));
  const ConfigValue axis = axisWith(shaper("ei", 42.0));
  expectIssues(axis, {{"input_shaper/type", "zvd",
                       "is \"zvd\", but must be zv, mzv, ei or 2hump_ei; did you mean zv?"},
                      {"input_shaper/frequency", 1001, "is 1001, but must be from 0.5 to 1000"},
                      {"input_shaper/frequency", "42 Hz",
                       "is \"42 Hz\" (a string), but must be a number from 0.5 to 1000"},
                      {"input_shaper/frequency", ConfigValue::List{},
                       "is a list of 0, but must be a number from 0.5 to 1000"},
                      {"input_shaper/frequency", ConfigValue::List{42.0, 0.1},
                       "has 0.1, but must have numbers from 0.5 to 1000 only"},
                      {"input_shaper/frequency", ConfigValue::List{42.0, true},
                       "has true, but must have numbers from 0.5 to 1000 only"},
                      {"input_shaper/damping", -0.1, "is -0.1, but must be from 0 to 0.9"},
                      {"input_shaper/damping", 1.0, "is 1.0, but must be from 0 to 0.9"}});
  EXPECT_EQ(issuesOfX(axisWith(mapOf({{"type", "zv"}}))),
            lineOfX("input_shaper/frequency", "is missing; it must be a number from 0.5 to 1000"));
}

TEST(ReadShaper, RefusesMoreThanSixteenParts) {
  EXPECT_EQ(issuesOfX(axisWith(shaper("zv", ConfigValue::List{20, 30, 40, 50}))), Lines{});
  EXPECT_EQ(issuesOfX(axisWith(shaper("ei", ConfigValue::List{20, 30, 40}))),
            lineOfX("input_shaper",
                    "divides each motion into 27 parts, but may divide it into 16 at most: zv has "
                    "2 for each frequency, mzv and ei have 3, and 2hump_ei has 4, and several "
                    "multiply"));
}

TEST(ReadShaper, RefusesAStartSpeedAndABacklash) {
  expectIssues(axisWith(shaper("zv", 42.0)),
               {{"start_speed_mm_s", 1.5,
                 "is 1.5, but must be 0 with /axes/x/input_shaper: divided into parts, the jump to "
                 "this speed would come when the motor already moves"},
                {"backlash_mm", 0.2,
                 "is 0.2, but must be 0 with /axes/x/input_shaper: divided into parts, a reversal "
                 "might not take up all of it"},
                {"start_speed_mm_s", 0, ""}});
}

}  // namespace
}  // namespace stepdriver::config
