#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <limits>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "common/node_config.h"
#include "support/node_under_test.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

struct BadBringUp {
  std::string name;
  std::function<void(NodeUnderTest&)> spoil;
  std::string parameter;  ///< below the node's name
  std::vector<std::string> words;
};

void PrintTo(const BadBringUp& bad, std::ostream* out) {  // NOLINT: GoogleTest's name for it
  *out << bad.name;
}

template <typename Value>
std::function<void(NodeUnderTest&)> setting(const std::string& key, const Value& value) {
  return [key, value](NodeUnderTest& node) { node.set(key, value); };
}

std::function<void(NodeUnderTest&)> erasing(const std::string& key) {
  return [key](NodeUnderTest& node) { node.erase(key); };
}

/// The line of the output with this parameter; empty if there is none.
std::string lineWith(const std::string& output, const std::string& parameter) {
  std::istringstream lines(output);
  for (std::string line; std::getline(lines, line);) {
    if (line.find(parameter + " ") != std::string::npos) return line;
  }
  return {};
}

class BringUp : public testing::TestWithParam<BadBringUp> {};

TEST_P(BringUp, IsRefusedWithParameterValueAndWhatIsAllowed) {
  NodeUnderTest node;
  const std::string trace = node.traced();
  GetParam().spoil(node);
  node.launch();
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 1) << node.process().output();
  const std::string line = lineWith(node.process().output(), node.full(GetParam().parameter));
  EXPECT_FALSE(line.empty()) << GetParam().parameter << " isn't in\n" << node.process().output();
  for (const std::string& words : GetParam().words) expectSays(line, words);
  EXPECT_FALSE(std::filesystem::exists(trace)) << "a line was touched";
}

const std::vector<BadBringUp> kBadBringUps = {
    {"NoAxes", erasing("axes"), "axes", {"missing"}},
    {"NoBackend", erasing("gpio"), "gpio/backend", {"missing", "simulated"}},
    {"UnknownBackend",
     setting("gpio/backend", "simulatd"),
     "gpio/backend",
     {"\"simulatd\"", "simulated", "libgpiod"}},
    {"TraceOfRealLines",
     setting("gpio/backend", "libgpiod"),
     "simulation/trace",
     {".vcd\"", "only the simulated rig"}},
    {"MissingDriver", erasing("axes/x/driver"), "axes/x/driver", {"missing", "a4988"}},
    {"UnknownDriver",
     setting("axes/x/driver", "a4989"),
     "axes/x/driver",
     {"\"a4989\"", "did you mean a4988"}},
    {"MissingStepPin", erasing("axes/x/pins/step"), "axes/x/pins/step", {"missing"}},
    {"PinUsedTwice", setting("axes/x/pins/dir", "x_step"), "axes/x/pins/dir", {"\"x_step\""}},
    {"WrongType",
     setting("axes/x/max_speed_mm_s", "fast"),
     "axes/x/max_speed_mm_s",
     {"\"fast\"", "number"}},
    {"BooleanAsText",
     setting("axes/x/enable_on_start", "false"),
     "axes/x/enable_on_start",
     {"true or false"}},
    {"FractionalMicrosteps", setting("axes/x/microsteps", 16.5), "axes/x/microsteps", {"16.5"}},
    {"UnknownMicrosteps", setting("axes/x/microsteps", 32), "axes/x/microsteps", {"32", "16"}},
    {"NotANumber", setting("axes/x/max_speed_mm_s", kNan), "axes/x/max_speed_mm_s", {"finite"}},
    {"Infinite",
     setting("axes/x/acceleration_mm_s2", kInfinity),
     "axes/x/acceleration_mm_s2",
     {"finite"}},
    {"Zero", setting("axes/x/steps_per_mm", 0.0), "axes/x/steps_per_mm", {"above 0"}},
    {"Negative",
     setting("axes/x/acceleration_mm_s2", -500),
     "axes/x/acceleration_mm_s2",
     {"-500", "above 0"}},
    {"TooFast", setting("axes/x/max_speed_mm_s", 1e6), "axes/x/max_speed_mm_s", {"steps/s"}},
    {"MinAboveMax",
     setting("axes/x/min_position_mm", 300),
     "axes/x/min_position_mm",
     {"300", "max_position_mm"}},
    {"StepsPerRoundAgainstMicrosteps",
     setting("axes/x/steps_per_round", 201),
     "axes/x/steps_per_round",
     {"201", "microsteps"}},
    {"UnknownKey",
     setting("axes/x/max_sped_mm_s", 1.0),
     "axes/x/max_sped_mm_s",
     {"did you mean max_speed_mm_s"}},
    {"UnknownKeyOfTheNode",
     setting("joint_state_rte", 50),
     "joint_state_rte",
     {"did you mean joint_state_rate"}},
    {"RateOutOfRange", setting("joint_state_rate", 2000), "joint_state_rate", {"2000", "1000"}},
    {"UnknownPolicyForALostMaster",
     setting("on_master_lost", "ignore"),
     "on_master_lost",
     {"ignore", "continue or stop"}},
    {"ClockThatStands",
     [](NodeUnderTest& node) {
       node.set("publish_clock", true);
       node.set("simulation/speed", 0.0);
     },
     "publish_clock",
     {"simulation/speed is 0", "above 0"}},
    {"ClockOfRealLines",
     [](NodeUnderTest& node) {
       node.set("publish_clock", true);
       node.set("gpio/backend", "libgpiod");
     },
     "publish_clock",
     {"gpio/backend is libgpiod", "only the simulated rig"}},
    {"IdleWithoutThePin",
     [](NodeUnderTest& node) {
       node.set("axes/x/idle_timeout_s", 10.0);
       node.erase("axes/x/pins/enable");
     },
     "axes/x/idle_timeout_s",
     {"10.0", "axes/x/pins/enable, which isn't wired"}},
    {"EmergencyStopWithoutALevel",
     setting("emergency_stop/pin", "stop"),
     "emergency_stop/active_level",
     {"missing", "low or high"}},
    {"EmergencyStopOnALineOfAnAxis",
     [](NodeUnderTest& node) {
       node.set("emergency_stop/pin", "x_endstop_min");
       node.set("emergency_stop/active_level", "high");
     },
     "emergency_stop/pin",
     {"\"x_endstop_min\"", "axes/x/endstops/min/pin already"}},
    {"ButtonWithoutAnEmergencyStop",
     setting("simulation/emergency_stop", true),
     "simulation/emergency_stop",
     {"true", "is missing"}},
    {"ButtonOfAnEmergencyStopWithoutOne",
     [](NodeUnderTest& node) {
       node.set("simulation/emergency_stop", true);
       node.set("emergency_stop/disable", "hold");
     },
     "simulation/emergency_stop",
     {"true", "emergency_stop/pin is missing"}},
    {"UnknownDisable",
     setting("emergency_stop/disable", "of"),
     "emergency_stop/disable",
     {"\"of\"", "did you mean off"}},
    {"DisableThatIsTrue",
     setting("emergency_stop/disable", true),
     "emergency_stop/disable",
     {"true", "hold, ramp or off"}},
    {"MotorThatAnEmergencyStopCannotSwitchOff",
     [](NodeUnderTest& node) {
       node.set("emergency_stop/disable", "off");
       node.erase("axes/x/pins/enable");
     },
     "emergency_stop/disable",
     {"is off", "axes/x/pins/enable is missing"}},
    {"LatenessOfZero",
     setting("realtime/max_lateness_ms", 0.0),
     "realtime/max_lateness_ms",
     {"above 0"}},
    {"UnknownRealtimePolicy",
     setting("realtime/policy", "enforced"),
     "realtime/policy",
     {"\"enforced\"", "did you mean enforce"}},
    {"AwakeByANumber",
     setting("realtime/keep_cpus_awake", 1),
     "realtime/keep_cpus_awake",
     {"1", "true or false"}},
    {"NoProcessor", setting("realtime/cpu", -1), "realtime/cpu", {"-1", "from 0 to 1023"}},
    {"UnknownRealtimeWord", setting("realtime", "enforec"), "realtime", {"\"enforec\"", "warn"}},
    {"RealtimeThatIsNoWord", setting("realtime", 5.0), "realtime", {"5", "map"}},
    {"NegativeSimulationSpeed", setting("simulation/speed", -1), "simulation/speed", {"-1"}},
    {"SimulatedAxisThatIsNone",
     setting("simulation/axes/xx/bounces", 1),
     "simulation/axes/xx",
     {"did you mean x"}},
    {"SimulationInTheWrongUnit",
     setting("simulation/axes/x/start_deg", 1.0),
     "simulation/axes/x/start_deg",
     {"not known"}},
    {"StuckInAnUnknownWay",
     setting("simulation/axes/x/min_stuck", "on"),
     "simulation/axes/x/min_stuck",
     {"\"on\"", "active", "inactive", "none"}},
    {"SwitchesTheWrongWayRound",
     setting("simulation/axes/x/min_switch_mm", 500.0),
     "simulation/axes/x",
     {"500", "202"}},
    {"AxesThatAreNoMap",
     [](NodeUnderTest& node) {
       node.erase("axes");
       node.set("axes", "x");
     },
     "axes",
     {"\"x\"", "map"}},
    {"AxisNameThatRosDoesNotTake",
     [](NodeUnderTest& node) {
       // The path through a YAML file, which may give a parameter any name.
       XmlRpc::XmlRpcValue axes;
       axes["x-axis"]["driver"] = "a4988";
       node.set("axes", axes);
     },
     "axes/x-axis",
     {"letter"}},
    {"AxisNameThatWouldForgeALineOfTheLog",
     [](NodeUnderTest& node) {
       XmlRpc::XmlRpcValue axes;
       axes["x\n[ERROR] y"]["driver"] = "a4988";
       node.set("axes", axes);
     },
     R"(axes/x\n[ERROR] y)",
     {R"("x\n[ERROR] y")", "letter"}},
    {"JointNameThatWouldForgeALineOfTheLog",
     setting("axes/x/joint", "x\n[ERROR] y"),
     "axes/x/joint",
     {R"("x\n[ERROR] y")", "without line breaks"}},
    {"TraceThatCannotBeWritten",
     setting("simulation/trace", "/nowhere/at/all.vcd"),
     "simulation/trace",
     {"/nowhere/at/all.vcd"}},
};

INSTANTIATE_TEST_SUITE_P(With, BringUp, testing::ValuesIn(kBadBringUps),
                         [](const auto& value) { return value.param.name; });

TEST(BringUpWithManyMistakes, ListsThemAllAtOnce) {
  NodeUnderTest node;
  node.set("gpio/backend", "gpio");
  node.set("joint_state_rate", "often");
  node.set("axes/x/microsteps", 3);
  node.set("axes/x/max_position_mm", -1.0);
  node.set("axes/x/speed", 1.0);
  node.set("simulation/axes/x/bounces", -1);
  node.launch();
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 1) << node.process().output();
  const std::string output = node.process().output();
  for (const char* key : {"gpio/backend", "joint_state_rate", "axes/x/microsteps",
                          "axes/x/min_position_mm", "axes/x/speed", "simulation/axes/x/bounces"}) {
    EXPECT_FALSE(lineWith(output, node.full(key)).empty()) << key << " isn't in\n" << output;
  }
  expectSays(output, "6 errors");
}

TEST(BringUpWithAStatusFrequency, OutOfItsRangeIsRefused) {
  // It belongs to all action servers of a namespace, not to this node alone.
  const std::string key = "actionlib_status_frequency";
  for (const auto& [frequency, words] : std::vector<std::pair<double, std::string>>{
           {1e9, "is 1000000000.0, but must be from 0 to 1000"},
           {-1.0, "is -1.0, but must be from 0 to 1000"},
           {1e-9, "is 1e-09, but must be 0, so that no status is published, or at least 0.01"},
           {kInfinity, "but must be a finite number from 0 to 1000"},
           {kNan, "but must be a finite number from 0 to 1000"}}) {
    SCOPED_TRACE(frequency);
    NodeUnderTest node;
    ros::param::set(node.beside(key), frequency);
    node.launch();
    ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 1) << node.process().output();
    expectSays(node.process().output(), node.beside(key) + " is ");
    expectSays(node.process().output(), words);
  }
  NodeUnderTest node;
  ros::param::set(node.beside(key), "often");
  node.launch();
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 1) << node.process().output();
  expectSays(node.process().output(), node.beside(key) + " is \"often\" (a string), but must be");
}

TEST(BringUpWithAStatusFrequency, OfZeroOrInItsRangeStarts) {
  for (const double frequency : {0.0, 0.01, 50.0}) {
    NodeUnderTest node;
    ros::param::set(node.beside("actionlib_status_frequency"), frequency);
    node.start();
    EXPECT_TRUE(node.moveTo(0.001, true).success) << frequency;
  }
}

TEST(BringUpOnGpioLines, OfWhichThereIsNoneEndsWithTheLineAndTheWayOut) {
  NodeUnderTest node;
  node.set("gpio/backend", "libgpiod");
  node.launch();
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 2) << node.process().output();
  expectSays(node.process().output(), "x_enable");
  expectSays(node.process().output(), "gpiochip");
}

TEST(BringUpByHand, HelpExplainsAndUnknownArgumentsAreRefused) {
  NodeProcess help({"--help"});
  EXPECT_EQ(help.waitForExit(kBound).value_or(-1), 0);
  expectSays(help.output(), "usage");
  expectSays(help.output(), "~axis_states");
  for (const std::string& name : ros_node::parameterNames()) {
    expectSays(help.output(), ("~" + name + " ").c_str());
  }
  NodeProcess unknown({"--hlep"});
  EXPECT_EQ(unknown.waitForExit(kBound).value_or(0), 64);
  expectSays(unknown.output(), "--hlep isn't an option");
  expectSays(unknown.output(), "usage");
}

}  // namespace
}  // namespace stepdriver::node_test
