// Motors of phases: lines switch their coils.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "support/axis_config.h"

namespace stepdriver::config {
namespace {

ConfigValue coilAxis() {
  return mapOf({{"driver", "uln2003"},
                {"pins", mapOf({{"in1", "A"}, {"in2", "B"}, {"in3", "C"}, {"in4", "D"}})},
                {"microsteps", 2},
                {"full_steps_per_round", 32},
                {"gear_ratio", 63.68395},
                {"max_speed_deg_s", 50.0},
                {"acceleration_deg_s2", 200.0}});
}

TEST(ReadPhases, TakesTheFourLinesOfAUln2003) {
  const AxisConfig config = readX(coilAxis());
  EXPECT_TRUE(config.hasPhases());
  EXPECT_TRUE(config.hasSwitchedCurrent());
  EXPECT_TRUE(config.stepsOnBothEdges()) << "each change of the coils is a step";
  EXPECT_EQ(config.pins.coil(0).line, "A");
  EXPECT_EQ(config.pins.coil(3).line, "D");
  EXPECT_NEAR(config.steps_per_unit * 2 * 3.14159265358979, 64 * 63.68395, 1e-6);
}

TEST(ReadPhases, RefusesThePinsOfADriverWithPulses) {
  const std::string none = ", but the ULN2003 has no ";
  const std::string only = " pin: it has IN1 to IN4";
  expectIssues(coilAxis(),
               {{"pins/enable", "E", "is \"E\"" + none + "ENABLE" + only},
                {"pins/ms1", "E", "is \"E\"" + none + "MS1" + only},
                {"pins/sleep", "E", "is \"E\"" + none + "SLEEP" + only},
                {"pins/step", "E", "is \"E\"" + none + "STEP" + only},
                {"pins/in3", "A",
                 "is \"A\", which is used twice: it is /axes/x/pins/in1 already, and each pin "
                 "needs a line of its own"},
                {"invert/in2", true, ""},
                {"microsteps", 4, "is 4, but must be 1 or 2"},
                {"idle_timeout_s", 5.0, ""},
                {"brake", mapOf({{"pin", "E"}, {"release_ms", 10}, {"engage_ms", 10}}), ""}});
  expectIssues(linearAxis(),
               {{"pins/in1", "E", "is \"E\", but the A4988 has no IN1 pin: it has STEP and DIR"}});
}

TEST(ReadPhases, RefusesOtherInputsThanItsDriverHas) {
  expectIssues(
      coilAxis(),
      {{"chip/step_inputs", "phases", ""},
       {"chip/step_inputs", "cw_ccw",
        "is \"cw_ccw\", but the ULN2003 switches the coils of its motor: it is phases"},
       {"chip/step_edges", "one",
        "is \"one\", but must be both: each change of the coils that the ULN2003 switches is a "
        "step"}});
  expectIssues(linearAxis(), {{"chip/step_inputs", "phases",
                               "is \"phases\", but the A4988 takes pulses; a uln2003 has phases"}});
}

TEST(ReadPhases, PassTheChecksOfAProgramsOwnAxes) {
  const AxisConfig config = readX(coilAxis());
  EXPECT_NO_THROW(checkAxes({config}));
}

}  // namespace
}  // namespace stepdriver::config
