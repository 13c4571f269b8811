#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "support/axis_config.h"

namespace stepdriver::config {
namespace {

ConfigValue tmcAxis(const std::string& lines = "gpiochip0") {
  ConfigValue axis = linearAxis(lines);
  put(axis, "driver", std::string("tmc2209"));
  put(axis, "tmc/port", std::string("/dev/serial0"));
  put(axis, "tmc/address", 1);
  put(axis, "tmc/sense_resistor_mohm", 110.0);
  put(axis, "tmc/run_current_a", 0.8);
  return axis;
}

TEST(ReadTmc, TakesAChipOnAUart) {
  const AxisConfig config = readX(tmcAxis());
  ASSERT_TRUE(config.tmc);
  EXPECT_EQ(config.tmc->port, "/dev/serial0");
  EXPECT_EQ(config.tmc->baud, 115'200);
  EXPECT_EQ(config.tmc->address, 1);
  EXPECT_DOUBLE_EQ(config.tmc->sense_resistor, 0.11);
  EXPECT_DOUBLE_EQ(config.tmc->run_current, 0.8);
  EXPECT_DOUBLE_EQ(config.tmc->hold_current, 0.4);
  EXPECT_EQ(config.tmc->mode, ChopperMode::kStealthChop);
  EXPECT_TRUE(config.tmc->interpolate);
  EXPECT_FALSE(readX(linearAxis()).tmc);
}

TEST(ReadTmc, HasEachPowerOfTwoAsMicrosteps) {
  for (int microsteps = 1; microsteps <= 256; microsteps *= 2) {
    ConfigValue axis = tmcAxis();
    put(axis, "microsteps", microsteps);
    EXPECT_EQ(readX(axis).microsteps, microsteps);
  }
  ConfigValue axis = tmcAxis();
  put(axis, "microsteps", 5);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("microsteps", "is 5, but must be 1, 2, 4, 8, 16, 32, 64, 128 or 256"));
}

TEST(ReadTmc, IsHintedAtIfOnlyItsRegistersHaveTheMicrosteps) {
  ConfigValue axis = linearAxis();
  put(axis, "driver", std::string("tmc2209"));
  put(axis, "microsteps", 256);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("microsteps",
                    "is 256, but must be 8, 16, 32 or 64; with a section tmc: also "
                    "by registers, 1 to 256"));
}

TEST(ReadTmc, RefusesWrongValues) {
  expectIssues(
      tmcAxis(),
      {{"tmc/port", std::string("serial0"),
        "is \"serial0\", but must be the path of a serial port, such as \"/dev/serial0\""},
       {"tmc/baud", 250'000,
        "is 250000, but must be 9600, 19200, 38400, 57600, 115200, 230400, 460800 or "
        "500000"},
       {"tmc/address", 4, "is 4, but must be from 0 to 3"},
       {"tmc/sense_resistor_mohm", 1.0, "is 1.0, but must be from 10 to 1000"},
       {"tmc/mode", std::string("quiet"), "is \"quiet\", but must be stealthchop or spreadcycle"},
       {"tmc/run_current_a", 11.0,
        "is 11, but must be from 0.030596 to 1.76776: with a sense resistor of 110.0 mOhm the "
        "board makes no other current; read the value off the board"},
       {"tmc/hold_current_a", 0.9,
        "is 0.9, but must be from 0.030596 to 0.8: with a sense resistor of 110.0 mOhm the board "
        "makes no other current; read the value off the board"}});
}

TEST(ReadTmc, StepsOnOneEdgeOrBoth) {
  ConfigValue axis = tmcAxis();
  EXPECT_FALSE(readX(axis).stepsOnBothEdges());
  put(axis, "tmc/step_edges", std::string("both"));
  EXPECT_TRUE(readX(axis).stepsOnBothEdges());
  expectIssues(axis, {{"tmc/step_edges", std::string("falling"),
                       "is \"falling\", but must be one or both"}});
}

TEST(ReadTmc, TakesTheSpeedAboveWhichItChopsAudibly) {
  ConfigValue axis = tmcAxis();
  put(axis, "tmc/spreadcycle_above_mm_s", 30.0);
  // 16 microsteps and 80 steps/mm: 5 full steps/mm.
  EXPECT_DOUBLE_EQ(readX(axis).tmc->spread_cycle_above, 150.0);
  expectIssues(
      axis, {{"tmc/spreadcycle_above_mm_s", 0.0, "is 0.0, but must be above 0"},
             {"tmc/spreadcycle_above_mm_s", 0.001,
              "is 0.001, but must be from 0.00894071 to 9375: the chip compares no other speeds "
              "with this travel of a step"},
             {"tmc/spreadcycle_above_mm_s", 9376.0,
              "is 9376.0, but must be from 0.00894071 to 9375: the chip compares no other speeds "
              "with this travel of a step"}});
  put(axis, "tmc/mode", std::string("spreadcycle"));
  EXPECT_EQ(issuesOfX(axis), lineOfX("tmc/spreadcycle_above_mm_s",
                                     "is 30.0, but is only for mode stealthchop: the mode is "
                                     "spreadcycle at each speed"));
  axis = tmcAxis();
  put(axis, "tmc/spreadcycle_above_deg_s", 30.0);
  EXPECT_EQ(issuesOfX(axis), lineOfX("tmc/spreadcycle_above_deg_s",
                                     "is 30.0, but the axis's speeds are in mm/s: give "
                                     "/axes/x/tmc/spreadcycle_above_mm_s"));
}

TEST(ReadTmc, TakesStallsInAnyMotionAsAFault) {
  ConfigValue axis = tmcAxis();
  EXPECT_FALSE(readX(axis).tmc->stall_fault);
  put(axis, "tmc/stall_fault_threshold", 60);
  EXPECT_EQ(issuesOfX(axis), lineOfX("tmc/stall_fault_threshold",
                                     "is 60, but /axes/x/tmc/stall_fault_above_mm_s is missing"));
  put(axis, "tmc/stall_fault_above_mm_s", 20.0);
  ASSERT_TRUE(readX(axis).tmc->stall_fault);
  EXPECT_EQ(readX(axis).tmc->stall_fault->threshold, 60);
  EXPECT_DOUBLE_EQ(readX(axis).tmc->stall_fault->above, 100.0);
  expectIssues(axis, {{"tmc/stall_fault_threshold", 256, "is 256, but must be from 0 to 255"},
                      {"tmc/stall_fault_above_mm_s", 0.001,
                       "is 0.001, but must be from 0.00894071 to 9375: the chip compares no other "
                       "speeds with this travel of a step"},
                      {"tmc/stall_fault_above_mm_s", 100.1,
                       "is 100.1, but must be below the axis's highest speed: a stall would never "
                       "be detected"}});
  put(axis, "tmc/spreadcycle_above_mm_s", 20.0);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("tmc/stall_fault_above_mm_s",
                    "is 20.0, but must be below /axes/x/tmc/spreadcycle_above_mm_s: the chip "
                    "detects stalls in stealthchop only"));
  drop(axis, "tmc/spreadcycle_above_mm_s");
  drop(axis, "tmc/stall_fault_threshold");
  EXPECT_EQ(issuesOfX(axis), lineOfX("tmc/stall_fault_above_mm_s",
                                     "is 20.0, but /axes/x/tmc/stall_fault_threshold is missing"));
  put(axis, "tmc/stall_fault_threshold", 60);
  put(axis, "tmc/mode", std::string("spreadcycle"));
  EXPECT_EQ(issuesOfX(axis), lineOfX("tmc/stall_fault_threshold",
                                     "is 60, but the chip detects stalls in stealthchop only"));
  drop(axis, "tmc/mode");
  put(axis, "driver", std::string("tmc2208"));
  put(axis, "tmc/address", 0);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("tmc/stall_fault_threshold", "is 60, but the TMC2208 detects no stalls"));
}

TEST(ReadTmc, TakesALowerCurrentForTheIdleTimeout) {
  ConfigValue axis = tmcAxis();
  put(axis, "idle_timeout_s", 2.0);
  put(axis, "idle_action", std::string("lower_current"));
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("idle_action", "is lower_current, but /axes/x/tmc/idle_current_a is missing"));
  put(axis, "tmc/idle_current_a", 0.1);
  EXPECT_EQ(readX(axis).idle_action, IdleAction::kLowerCurrent);
  EXPECT_DOUBLE_EQ(readX(axis).tmc->idle_current.value(), 0.1);
  expectIssues(axis,
               {{"tmc/idle_current_a", 0.01,
                 "is 0.01, but must be from 0.030596 to 0.4: with a sense resistor of 110.0 mOhm "
                 "the board makes no other current; read the value off the board"},
                {"tmc/idle_current_a", 0.5,
                 "is 0.5, but must be from 0.030596 to 0.4: with a sense resistor of 110.0 mOhm "
                 "the board makes no other current; read the value off the board"}});
  put(axis, "idle_action", std::string("disable"));
  put(axis, "idle_timeout_s", 0.0);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("idle_action",
                    "is disable, but /axes/x/tmc/idle_current_a is given, which is "
                    "only for lower_current"));
}

TEST(ReadTmc, EndsMotionsAtAFaultAsItIsTold) {
  ConfigValue axis = tmcAxis();
  EXPECT_FALSE(readX(axis).fault_ramps);
  put(axis, "fault_stop", std::string("ramp"));
  EXPECT_TRUE(readX(axis).fault_ramps);
}

// The current shows that the resistor is wrong by a factor.
TEST(ReadTmc, RefusesACurrentThatTheBoardCannotMake) {
  ConfigValue axis = tmcAxis();
  put(axis, "tmc/sense_resistor_mohm", 900.0);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("tmc/run_current_a",
                    "is 0.8, but must be from 0.00432335 to 0.249793: with a sense resistor of "
                    "900.0 mOhm the board makes no other current; read the value off the board"));
}

TEST(ReadTmc, SaysWhatIsMissing) {
  expectMissing(tmcAxis(), {{"tmc/port", "a string"},
                            {"tmc/address", "an integer from 0 to 3"},
                            {"tmc/sense_resistor_mohm", "a number from 10 to 1000"},
                            {"tmc/run_current_a", "a number above 0"}});
}

TEST(ReadTmc, IsOnlyForChipsWithAUart) {
  ConfigValue axis = tmcAxis();
  put(axis, "driver", std::string("a4988"));
  EXPECT_EQ(issuesOfX(axis), lineOfX("tmc",
                                     "is given, but is only for tmc2208, tmc2209, tmc2226, "
                                     "tmc2130 and tmc5160; the driver is the A4988"));
}

TEST(ReadTmc, KnowsThatATmc2208HasOneAddress) {
  ConfigValue axis = tmcAxis();
  put(axis, "driver", std::string("tmc2208"));
  EXPECT_EQ(issuesOfX(axis), lineOfX("tmc/address",
                                     "is 1, but a TMC2208 has no address pins: it must be 0, and "
                                     "the chip alone on its port"));
  drop(axis, "tmc/address");
  EXPECT_EQ(readX(axis).tmc->address, 0);
}

TEST(ReadTmc, NeedsAnAddressAndARateForEachChipOfAPort) {
  ConfigValue second = tmcAxis("gpiochip1");
  EXPECT_EQ(issuesOf(mapOf({{"x", tmcAxis()}, {"y", second}})),
            Lines{"/axes/y/tmc/address: is 1, but must be another one: it is /axes/x/tmc/address "
                  "already, on the same port"});
  put(second, "tmc/address", 2);
  EXPECT_EQ(issuesOf(mapOf({{"x", tmcAxis()}, {"y", second}})), Lines{});
  put(second, "tmc/baud", 9600);
  EXPECT_EQ(issuesOf(mapOf({{"x", tmcAxis()}, {"y", second}})),
            Lines{"/axes/y/tmc/baud: is 9600, but must be 115200, as /axes/x/tmc/baud: it is the "
                  "same port"});
}

ConfigValue spiAxis(const std::string& driver, const std::string& lines = "gpiochip0") {
  ConfigValue axis = tmcAxis(lines);
  drop(axis, "tmc/port");
  drop(axis, "tmc/address");
  put(axis, "driver", driver);
  put(axis, "tmc/spi", std::string("/dev/spidev0.0"));
  return axis;
}

TEST(ReadTmc, TakesAChipOnSpi) {
  for (const std::string driver : {"tmc2130", "tmc5160"}) {
    ConfigValue axis = spiAxis(driver);
    put(axis, "microsteps", 256);
    const AxisConfig config = readX(axis);
    ASSERT_TRUE(config.tmc);
    EXPECT_EQ(config.tmc->port, "/dev/spidev0.0");
    EXPECT_EQ(config.tmc->baud, 0);
    expectIssues(spiAxis(driver),
                 {{"tmc/spi", std::string("spidev0.0"),
                   "is \"spidev0.0\", but must be the path of an SPI device, such as "
                   "\"/dev/spidev0.0\""}});
    expectMissing(spiAxis(driver), {{"tmc/spi", "a string"}});
  }
  EXPECT_EQ(issuesOf(mapOf({{"x", spiAxis("tmc2130")}, {"y", spiAxis("tmc5160", "gpiochip1")}})),
            Lines{"/axes/y/tmc/spi: is \"/dev/spidev0.0\", but must be another one: it is "
                  "/axes/x/tmc/spi already"});
  ConfigValue axis = spiAxis("tmc5160");
  put(axis, "tmc/stall_threshold", -64);
  put(axis, "tmc/mode", std::string("spreadcycle"));
  EXPECT_EQ(readX(axis).tmc->stall->threshold, -64);
  expectIssues(axis, {{"tmc/stall_threshold", -65, "is -65, but must be from -64 to 63"},
                      {"tmc/stall_threshold", 64, "is 64, but must be from -64 to 63"}});
  put(axis, "tmc/stall_fault_above_mm_s", 20.0);
  put(axis, "tmc/stall_fault_threshold", -64);
  EXPECT_EQ(readX(axis).tmc->stall_fault->threshold, -64);
  expectIssues(axis, {{"tmc/stall_fault_threshold", -65, "is -65, but must be from -64 to 63"},
                      {"tmc/stall_fault_threshold", 64, "is 64, but must be from -64 to 63"}});
  put(axis, "tmc/stall_fault_threshold", 63);
  EXPECT_EQ(readX(axis).tmc->stall_fault->threshold, 63);
  drop(axis, "tmc/mode");
  EXPECT_EQ(issuesOfX(axis), lineOfX("tmc/stall_fault_threshold",
                                     "is 63, but the chip detects stalls in spreadcycle only"));
  axis = spiAxis("tmc5160");
  put(axis, "tmc/address", 1);
  EXPECT_NE(issuesOfX(axis).front().find("tmc/address: is not known; known here: "),
            std::string::npos);
  axis = tmcAxis();
  put(axis, "tmc/spi", std::string("/dev/spidev0.0"));
  EXPECT_NE(issuesOfX(axis).front().find("tmc/spi: is not known; "), std::string::npos);
}

TEST(ReadTmc, KnowsTheCurrentsOfEachChip) {
  ConfigValue axis = spiAxis("tmc5160");
  put(axis, "tmc/sense_resistor_mohm", 75.0);
  put(axis, "tmc/run_current_a", 3.1);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("tmc/run_current_a",
                    "is 3.1, but must be from 0.0119693 to 3.06412: with a sense resistor of 75.0 "
                    "mOhm the board makes no other current; read the value off the board"));
}

TEST(ReadTmc, LeavesNoMicrostepPins) {
  ConfigValue axis = tmcAxis();
  put(axis, "pins/ms1", std::string("M"));
  EXPECT_EQ(issuesOfX(axis), lineOfX("pins/ms1",
                                     "is \"M\", but the TMC2209 has no microstep pins "
                                     "with `tmc`: MS1 and MS2 are its address"));
}

TEST(ReadTmc, OfAProgramIsCheckedByTheSameRules) {
  std::vector<AxisConfig> axes{readX(tmcAxis())};
  EXPECT_NO_THROW(checkAxes(axes));
  axes[0].tmc->run_current = 5.0;
  EXPECT_THROW(checkAxes(axes), ConfigError);
}

}  // namespace
}  // namespace stepdriver::config
