#include "config/read_io.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/config_map.h"

namespace stepdriver::config {
namespace {

ConfigValue machineWith(const std::string& path, ConfigValue value) {
  ConfigValue machine = mapOf({});
  put(machine, "outputs/pen/pin", std::string("A"));
  put(machine, "inputs/probe/pin", std::string("B"));
  put(machine, "inputs/probe/active_level", std::string("low"));
  if (!path.empty()) put(machine, path, std::move(value));
  return machine;
}

/// What was read, and the issues with it.
struct Read {
  explicit Read(const ConfigValue& machine) {
    ConfigReader reader(machine, "", issues);
    UsedLines used(issues);
    outputs = readOutputs(reader, used, &axes);
    inputs = readInputs(reader, used);
  }
  static std::vector<AxisConfig> twoAxes() {
    std::vector<AxisConfig> both(2);
    both[0].name = "x";
    both[1].name = "turn";
    both[1].kind = Kind::kRotary;
    for (AxisConfig& axis : both) {
      axis.steps_per_unit = 80'000.0;
      axis.max_speed = 0.1;
    }
    return both;
  }
  const std::vector<AxisConfig> axes = twoAxes();
  std::vector<ConfigIssue> issues;
  std::vector<OutputConfig> outputs;
  std::vector<InputConfig> inputs;
};

std::string issueOf(const std::string& path, ConfigValue value) {
  const Lines lines = linesOf(Read(machineWith(path, std::move(value))).issues);
  return lines.size() == 1 ? lines.front() : std::to_string(lines.size()) + " issues";
}

ConfigValue compareWith(const std::string& axis, const std::string& key, ConfigValue value) {
  ConfigValue machine = machineWith("outputs/pen/position_compare/axis", axis);
  put(machine, "outputs/pen/position_compare/pulse_ms", 1.0);
  put(machine, "outputs/pen/position_compare/" + key, std::move(value));
  return machine;
}

TEST(ReadIo, ReadsWhatAPositionSwitchesInTheUnitsOfItsAxis) {
  using List = ConfigValue::List;
  const Read places(compareWith("x", "places_mm", List{1.0, 2, 30.5}));
  EXPECT_EQ(linesOf(places.issues), Lines());
  EXPECT_EQ(places.outputs.front().compare->places, (std::vector<double>{0.001, 0.002, 0.0305}));
  EXPECT_EQ(places.outputs.front().compare->pulse_ns, 1'000'000);
  const Read cams(compareWith("turn", "cams_deg", List{List{0.0, 90.0}, List{100.0, 180}}));
  EXPECT_EQ(linesOf(cams.issues), Lines());
  ASSERT_EQ(cams.outputs.front().compare->cams.size(), 2U);
  EXPECT_NEAR(cams.outputs.front().compare->cams[1].to, 3.14159265, 1e-8);
  ConfigValue every = compareWith("x", "every_mm", 2.0);
  put(every, "outputs/pen/position_compare/from_mm", 0.0);
  put(every, "outputs/pen/position_compare/to_mm", 100.0);
  put(every, "outputs/pen/position_compare/direction", std::string("up"));
  const Read each(every);
  EXPECT_EQ(linesOf(each.issues), Lines());
  EXPECT_EQ(each.outputs.front().compare->every->distance, 0.002);
  EXPECT_EQ(each.outputs.front().compare->direction, PositionCompare::Direction::kUp);
}

TEST(ReadIo, RefusesWhatAPositionCantSwitch) {
  using List = ConfigValue::List;
  const auto issue = [](const ConfigValue& machine) {
    const Lines lines = linesOf(Read(machine).issues);
    return lines.empty() ? "" : lines.front();
  };
  EXPECT_EQ(issue(compareWith("q", "at_end", true)),
            "/outputs/pen/position_compare/axis: is \"q\", but the axes are x, turn");
  EXPECT_EQ(issue(compareWith("x", "places_deg", List{1.0})),
            "/outputs/pen/position_compare/places_deg: is not known; did you mean "
            "places_mm?");
  EXPECT_EQ(issue(compareWith("x", "places_mm", 1.0)),
            "/outputs/pen/position_compare/places_mm: is 1.0, but must be a list");
  EXPECT_EQ(issue(compareWith("x", "places_mm", List{std::string("here")})),
            "/outputs/pen/position_compare/places_mm: has \"here\", but must have places only");
  EXPECT_EQ(
      issue(compareWith("x", "cams_mm", List{List{1.0}})),
      "/outputs/pen/position_compare/cams_mm: has a list of 1, but each cam must be a list of two "
      "places, where it begins and ends");
  EXPECT_EQ(issue(compareWith("x", "places_mm", List{1.0, 1.05})),
            "/outputs/pen/position_compare: has a distance between pulses of 5e-05 m, for which x "
            "takes 0.0005 s at 0.1 m/s, but a pulse and min_off_ms of it are 0.001 s");
}

TEST(ReadIo, HasDefaultsThatSwitchNothing) {
  const Read read(machineWith("", {}));
  EXPECT_EQ(linesOf(read.issues), Lines());
  ASSERT_EQ(read.outputs.size(), 1U);
  const OutputConfig& pen = read.outputs.front();
  EXPECT_EQ(pen.name, "pen");
  EXPECT_EQ(pen.line, "A");
  EXPECT_TRUE(pen.active_level);
  EXPECT_FALSE(pen.initial);
  EXPECT_FALSE(pen.at_stop);
  EXPECT_FALSE(pen.at_fault);
  EXPECT_FALSE(pen.max_on_ns);
  EXPECT_EQ(pen.min_on_ns, 0);
  EXPECT_EQ(pen.min_off_ns, 0);
  ASSERT_EQ(read.inputs.size(), 1U);
  EXPECT_EQ(read.inputs.front().name, "probe");
  EXPECT_EQ(read.inputs.front().line.line, "B");
  EXPECT_FALSE(read.inputs.front().line.active_level);
  EXPECT_EQ(read.inputs.front().debounce_ns, 0);
  const Read none{ConfigValue(mapOf({}))};
  EXPECT_TRUE(none.outputs.empty() && none.inputs.empty() && none.issues.empty());
}

TEST(ReadIo, TakesOnAndOffWithAndWithoutQuotes) {
  for (const ConfigValue& on : {ConfigValue(true), ConfigValue("on")}) {
    EXPECT_TRUE(Read(machineWith("outputs/pen/initial", on)).outputs.front().initial);
    EXPECT_TRUE(Read(machineWith("outputs/pen/at_fault", on)).outputs.front().at_fault);
    EXPECT_EQ(Read(machineWith("outputs/pen/at_stop", on)).outputs.front().at_stop, true);
    EXPECT_TRUE(Read(machineWith("outputs/pen/at_stop", on)).issues.empty());
  }
  EXPECT_EQ(Read(machineWith("outputs/pen/at_stop", false)).outputs.front().at_stop, false);
  EXPECT_EQ(Read(machineWith("outputs/pen/at_stop", "keep")).outputs.front().at_stop, std::nullopt);
}

TEST(ReadIo, TakesBothEndsOfEachRange) {
  const auto pen = [](const char* key, double value) {
    const Read read(machineWith(std::string("outputs/pen/") + key, value));
    EXPECT_EQ(linesOf(read.issues), Lines()) << key << " " << value;
    return read.outputs.front();
  };
  EXPECT_EQ(pen("max_on_s", 0.001).max_on_ns, 1'000'000);
  EXPECT_EQ(pen("max_on_s", 86'400.0).max_on_ns, 86'400'000'000'000);
  EXPECT_EQ(pen("min_on_ms", 0.0).min_on_ns, 0);
  EXPECT_EQ(pen("min_on_ms", 60'000.0).min_on_ns, 60'000'000'000);
  EXPECT_EQ(pen("min_off_ms", 60'000.0).min_off_ns, 60'000'000'000);
  EXPECT_EQ(Read(machineWith("inputs/probe/debounce_ms", 1000)).inputs.front().debounce_ns,
            1'000'000'000);
}

TEST(ReadIo, NamesWhatIsWrongItsValueAndWhatIsAllowed) {
  EXPECT_EQ(issueOf("outputs/pen/max_on_s", 0.0),
            "/outputs/pen/max_on_s: is 0.0, but must be from 0.001 to 86400");
  EXPECT_EQ(issueOf("outputs/pen/max_on_s", 86'401.0),
            "/outputs/pen/max_on_s: is 86401.0, but must be from 0.001 to 86400");
  EXPECT_EQ(issueOf("outputs/pen/min_on_ms", -1.0),
            "/outputs/pen/min_on_ms: is -1.0, but must be from 0 to 60000");
  EXPECT_EQ(issueOf("outputs/pen/min_off_ms", 60'001.0),
            "/outputs/pen/min_off_ms: is 60001.0, but must be from 0 to 60000");
  EXPECT_EQ(issueOf("inputs/probe/debounce_ms", 1001.0),
            "/inputs/probe/debounce_ms: is 1001.0, but must be from 0 to 1000");
  EXPECT_EQ(issueOf("outputs/pen/active_level", "on"),
            "/outputs/pen/active_level: is \"on\", but must be low or high");
  EXPECT_EQ(issueOf("outputs/pen/initial", "high"),
            "/outputs/pen/initial: is \"high\", but must be off or on");
  EXPECT_EQ(issueOf("outputs/pen/at_stop", "hold"),
            "/outputs/pen/at_stop: is \"hold\", but must be keep, off or on");
  EXPECT_EQ(
      issueOf("outputs/pen/pin", "a b"),
      "/outputs/pen/pin: is \"a b\", but must be a line: chip:offset, as \"gpiochip0:17\", or "
      "a line's name");
  EXPECT_EQ(issueOf("outputs/pen/max_on", 1.0),
            "/outputs/pen/max_on: is not known; did you mean max_on_s?");
  EXPECT_EQ(issueOf("inputs/probe/pin", "A"),
            "/inputs/probe/pin: is \"A\", which is used twice: it is /outputs/pen/pin already, and "
            "each pin needs a line of its own");
  EXPECT_EQ(
      issueOf("outputs/1st/pin", "C"),
      "/outputs/1st: has the name \"1st\", but the name of an output must begin with a letter "
      "and continue with letters, digits and _ only");
  EXPECT_EQ(issueOf("outputs/pen", 5), "/outputs/pen: is 5 (an integer), but must be a map");
}

TEST(ReadIo, RefusesAnOutputThatMayNotBeOnForLongIfItsSafeStateIsOn) {
  ConfigValue machine = machineWith("outputs/pen/max_on_s", 2.0);
  put(machine, "outputs/pen/at_fault", std::string("on"));
  EXPECT_EQ(linesOf(Read(machine).issues),
            Lines{"/outputs/pen/max_on_s: is 2.0, but /outputs/pen/at_fault is \"on\": in its safe "
                  "state the output is on for any time"});
  ConfigValue longer = machineWith("outputs/pen/max_on_s", 2.0);
  put(longer, "outputs/pen/min_on_ms", 2000.0);
  EXPECT_EQ(linesOf(Read(longer).issues), Lines());
  put(longer, "outputs/pen/min_on_ms", 2000.001);
  EXPECT_EQ(linesOf(Read(longer).issues),
            Lines{"/outputs/pen/max_on_s: is 2.0, but /outputs/pen/min_on_ms is 2000.001: the "
                  "output can't stay on for longer than it may"});
}

ConfigValue machineWithPwm(const std::string& kind) {
  ConfigValue machine = mapOf({});
  put(machine, "outputs/pen/" + kind + "/chip", 2);
  put(machine, "outputs/pen/" + kind + "/channel", 1);
  return machine;
}

TEST(ReadIo, ReadsPwmOutputsAndServos) {
  ConfigValue servo = machineWithPwm("servo");
  EXPECT_EQ(Read(servo).outputs.at(0).line, "pwmchip2:1/20000000/1000000/2000000");
  put(servo, "outputs/pen/servo/off_ms", 0.5);
  put(servo, "outputs/pen/servo/on_ms", 2.5);
  EXPECT_EQ(Read(servo).outputs.at(0).line, "pwmchip2:1/20000000/500000/2500000");
  ConfigValue pwm = machineWithPwm("pwm");
  put(pwm, "outputs/pen/pwm/frequency_hz", 1000.0);
  EXPECT_EQ(Read(pwm).outputs.at(0).line, "pwmchip2:1/1000000/0/1000000");
  put(pwm, "outputs/pen/pwm/on_percent", 30.0);
  put(pwm, "outputs/pen/pwm/off_percent", 2.5);
  const Read read(pwm);
  EXPECT_EQ(linesOf(read.issues), Lines());
  EXPECT_EQ(read.outputs.at(0).line, "pwmchip2:1/1000000/25000/300000");
  EXPECT_TRUE(read.outputs.at(0).level(true));
}

TEST(ReadIo, RefusesAPwmOutputThatMayNotBeOnForAPeriod) {
  ConfigValue servo = machineWithPwm("servo");
  put(servo, "outputs/pen/max_on_s", 0.02);
  EXPECT_EQ(linesOf(Read(servo).issues), Lines());
  put(servo, "outputs/pen/max_on_s", 0.0199);
  EXPECT_EQ(linesOf(Read(servo).issues),
            Lines{"/outputs/pen/max_on_s: is 0.0199, but the PWM period is 0.02 s: the output "
                  "can't stay on for longer than it may"});
}

TEST(ReadIo, WritesPwmOutputsAndServosAsTheyAreRead) {
  for (const char* const line :
       {"pwmchip0:0/20000000/1000000/2000000", "pwmchip7:3/1000000/25000/300000",
        "pwmchip0:1/1000/0/1", "pwmchip0:1/10000000000/1/9999999999", "pwmchip0:1/3333/1111/7"}) {
    OutputConfig output;
    output.name = "pen";
    output.line = line;
    const Read read(mapOf({{"outputs", writeOutputs({output})}}));
    EXPECT_EQ(linesOf(read.issues), Lines());
    EXPECT_EQ(read.outputs.at(0).line, line);
  }
}

TEST(ReadIo, RefusesWhatAPwmOutputCannotBe) {
  ConfigValue machine = machineWithPwm("pwm");
  EXPECT_EQ(linesOf(Read(machine).issues),
            Lines{"/outputs/pen/pwm/frequency_hz: is missing; it must be a number from 0.1 to "
                  "1000000"});
  for (const double wrong : {0.0, 0.09, 1.1e6}) {
    put(machine, "outputs/pen/pwm/frequency_hz", wrong);
    EXPECT_EQ(Read(machine).issues.size(), 1U) << wrong;
  }
  put(machine, "outputs/pen/pwm/frequency_hz", 50.0);
  put(machine, "outputs/pen/pwm/on_percent", 0.0);
  EXPECT_EQ(linesOf(Read(machine).issues),
            Lines{"/outputs/pen/pwm/on_percent: is the same as off: the output does nothing"});
  put(machine, "outputs/pen/pwm/on_percent", 100.0);
  put(machine, "outputs/pen/pin", std::string("A"));
  EXPECT_EQ(linesOf(Read(machine).issues),
            Lines{"/outputs/pen/pin: contradicts /outputs/pen/pwm: an output has one of pin, pwm "
                  "and servo"});
  ConfigValue twice = machineWithPwm("servo");
  put(twice, "outputs/lamp/servo/chip", 2);
  put(twice, "outputs/lamp/servo/channel", 1);
  const Lines issues = linesOf(Read(twice).issues);
  ASSERT_EQ(issues.size(), 1U);
  EXPECT_NE(issues[0].find("pwmchip2:1"), std::string::npos) << issues[0];
}

TEST(ReadIo, ReadsWhatItWrites) {
  OutputConfig pen{"pen", "A", false, true, false, false, 2'500'000'000, 1'500'000, 2'000'000};
  OutputConfig lamp{"lamp", "B", true, false, true, true, {}, 0, 0};
  InputConfig probe{"probe", {"C", true, Bias::kPullUp}, 2'500'000};
  const ConfigValue machine =
      mapOf({{"outputs", writeOutputs({pen, lamp})}, {"inputs", writeInputs({probe})}});
  const Read read(machine);
  EXPECT_EQ(linesOf(read.issues), Lines());
  ASSERT_EQ(read.outputs.size(), 2U);
  EXPECT_EQ(read.outputs[1].name, "pen");
  EXPECT_EQ(read.outputs[1].level(true), false);
  EXPECT_TRUE(read.outputs[1].initial);
  EXPECT_EQ(read.outputs[1].at_stop, false);
  EXPECT_EQ(read.outputs[1].max_on_ns, pen.max_on_ns);
  EXPECT_EQ(read.outputs[1].min_on_ns, pen.min_on_ns);
  EXPECT_EQ(read.outputs[1].min_off_ns, pen.min_off_ns);
  EXPECT_TRUE(read.outputs[0].at_fault);
  EXPECT_EQ(read.outputs[0].at_stop, true);
  ASSERT_EQ(read.inputs.size(), 1U);
  EXPECT_EQ(read.inputs[0].line.bias, Bias::kPullUp);
  EXPECT_EQ(read.inputs[0].debounce_ns, probe.debounce_ns);
}

}  // namespace
}  // namespace stepdriver::config
