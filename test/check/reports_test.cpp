#include <gtest/gtest.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "common/text.h"
#include "lines_report.h"
#include "move.h"
#include "options.h"
#include "rates_report.h"
#include "stepdriver_core/error.h"
#include "system_report.h"
#include "table.h"

namespace stepdriver::check {
namespace {

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(Table, HasColumnsAsWideAsTheirWidestWord) {
  EXPECT_EQ(table({{"a", "bb"}, {"long", "", "c"}, {"x"}}), "  a     bb\n  long      c\n  x\n");
}

TEST(NumberText, HasSixDigitsAndAnExponentOnlyWhereNobodyWouldReadTheZeros) {
  using ros_node::roundedText;
  EXPECT_EQ(roundedText(0.5), "0.5");
  EXPECT_EQ(roundedText(-1.0 / 3.0), "-0.333333");
  EXPECT_EQ(roundedText(99999.96), "100000");
  EXPECT_EQ(roundedText(1234567.8), "1234568");
  EXPECT_EQ(roundedText(-9e15), "-9000000000000000");
  EXPECT_EQ(roundedText(1e300), "1e+300");
}

std::vector<gpio::ChipInfo> twoChips() {
  gpio::ChipInfo header;
  header.name = "gpiochip0";
  header.label = "pinctrl-bcm2711";
  header.lines.resize(4);
  header.lines[1].name = "GPIO1";
  header.lines[2].used = true;
  header.lines[2].consumer = "gpioset";
  header.lines[3].used = true;
  gpio::ChipInfo closed;
  closed.name = "gpiochip1";
  closed.error = EACCES;
  return {header, closed};
}

TEST(LinesReport, TellsWhichPwmChannelsAreThere) {
  char folder[] = "/tmp/stepdriver-check-XXXXXX";
  ASSERT_NE(mkdtemp(folder), nullptr);
  const std::filesystem::path chip = std::filesystem::path(folder) / "pwmchip0";
  std::filesystem::create_directory(chip);
  std::ofstream(chip / "npwm") << "1\n";
  const LinesReport report = linesReport(twoChips(),
                                         {{"outputs/pen", "pwmchip0:0/20000000/1000000/2000000"},
                                          {"outputs/fan", "pwmchip0:1/20000000/1000000/2000000"}},
                                         folder);
  std::filesystem::remove_all(folder);
  EXPECT_EQ(report.missing, 1U);
  EXPECT_TRUE(has(report.text, std::string("outputs/pen  pwmchip0:0  ") + folder + "  PWM"))
      << report.text;
  EXPECT_TRUE(has(report.text, "pwmchip0:1: ")) << report.text;
  EXPECT_TRUE(has(report.text, "/pwmchip0/npwm reads 1, so the channel must be below that"))
      << report.text;
}

TEST(LinesReport, TellsWhereEachLineIsAndWhoHoldsIt) {
  const LinesReport report = linesReport(
      twoChips(), {{"x/step", "GPIO1"}, {"x/dir", "gpiochip0:2"}, {"x/enable", "gpiochip0:3"}});
  EXPECT_EQ(report.missing, 2U);
  EXPECT_EQ(report.text.rfind("  pin       line         found at     state\n"
                              "  x/step    GPIO1        gpiochip0:1  free\n"
                              "  x/dir     gpiochip0:2  gpiochip0:2  held by \"gpioset\"\n"
                              "  x/enable  gpiochip0:3  gpiochip0:3  held by the kernel\n",
                              0),
            0U)
      << report.text;
  EXPECT_TRUE(has(report.text, "Stop that program")) << report.text;
  EXPECT_EQ(linesReport(twoChips(), {{"x/step", "GPIO1"}}).missing, 0U);
}

TEST(LinesReport, SaysOnceWhatSeveralLinesLack) {
  const LinesReport report =
      linesReport(twoChips(), {{"x/step", "GPIO17"}, {"x/dir", "GPIO27"}, {"y/dir", "none:3"}});
  EXPECT_EQ(report.missing, 3U);
  EXPECT_TRUE(has(report.text, "  GPIO17, GPIO27: no chip has a line of that name."))
      << report.text;
  EXPECT_TRUE(has(report.text, "  none:3: there is no chip with the name or label none."))
      << report.text;
}

TEST(LinesReport, SaysThatTwoPinsHaveOneLine) {
  const LinesReport report =
      linesReport(twoChips(), {{"x/step", "GPIO1"}, {"x/dir", "gpiochip0:1"}});
  EXPECT_EQ(report.missing, 1U);
  EXPECT_TRUE(has(report.text, "the same line as x/step")) << report.text;
}

TEST(ChipsText, TellsWhyAChipCannotBeOpened) {
  const std::string text = chipsText(twoChips());
  EXPECT_TRUE(has(text, "  gpiochip0  pinctrl-bcm2711                               4\n") ||
              has(text, "gpiochip0  pinctrl-bcm2711"))
      << text;
  EXPECT_TRUE(has(text, "can't be opened: EACCES")) << text;
  EXPECT_TRUE(has(text, "60-stepdriver-gpio.rules")) << text;
  EXPECT_TRUE(has(chipsText({}), "no GPIO chip"));
}

TEST(LinesOf, AnAxisAreAllThatAreWired) {
  config::AxisConfig config;
  config.name = "x";
  config.driver = driver::driverChip("drv8825");
  config.pins.step.line = "S";
  config.pins.ms1.line = "M";
  config.endstop_min = config::Endstop{{"E", true, Bias::kAsIs}};
  config.fault = config::FaultPin{"F", Bias::kAsIs};
  std::string pins;
  for (const NamedLine& line : linesOf({config})) pins += line.pin + "=" + line.line + " ";
  EXPECT_EQ(pins, "x/step=S x/m0=M x/endstops/min=E x/fault=F ");
  config::AxisConfig other = config;
  other.name = "y";
  config.pins.enable.line = other.pins.enable.line = "N";
  const auto shared = linesOf({config, other});
  EXPECT_EQ(shared[1].pin + "=" + shared[1].line, "x/enable, y/enable=N");
  other.driver.step_inputs = driver::StepInputs::kCwCcw;
  other.pins.dir.line = "D";
  other.in_position = config::InPositionPin{"P"};
  pins.clear();
  for (const NamedLine& line : linesOf({other})) pins += line.pin + "=" + line.line + " ";
  EXPECT_EQ(pins, "y/cw=S y/ccw=D y/enable=N y/m0=M y/endstops/min=E y/fault=F y/in_position=P ");
  config::MotorConfig twin;
  twin.motor = "right";
  twin.driver = driver::driverChip("tmc2209");
  twin.pins.step.line = "R";
  twin.pins.ms1.line = "O";
  twin.pins.enable.line = "N";
  config.twins.push_back(twin);
  config.motor = "left";
  pins.clear();
  for (const NamedLine& line : linesOf({config})) pins += line.pin + "=" + line.line + " ";
  EXPECT_EQ(pins,
            "x/left/step=S x/left/enable, x/right/enable=N x/left/m0=M x/left/endstops/min=E "
            "x/left/fault=F x/right/step=R x/right/ms1=O ");
  config::AxisConfig coils;
  coils.name = "x";
  coils.driver = driver::driverChip("uln2003");
  coils.pins.in1.line = "A";
  coils.pins.in2.line = "B";
  coils.pins.in3.line = "C";
  coils.pins.in4.line = "D";
  pins.clear();
  for (const NamedLine& line : linesOf({coils})) pins += line.pin + "=" + line.line + " ";
  EXPECT_EQ(pins, "x/in1=A x/in2=B x/in3=C x/in4=D ");
  machine::MachineOptions options;
  options.emergency_stop = config::InputSwitch{"T", true, Bias::kAsIs};
  options.heartbeat = machine::HeartbeatConfig{"H"};
  options.motor_power = config::MotorPowerConfig{};
  options.motor_power->line = "P";
  options.motor_power->feedback = config::InputSwitch{"Q", false};
  pins.clear();
  for (const NamedLine& line : linesOf({}, options)) pins += line.pin + "=" + line.line + " ";
  EXPECT_EQ(pins, "emergency_stop=T motor_power=P motor_power/feedback=Q heartbeat=H ");
}

TEST(LinesReport, HasOutputsAndInputsWithAName) {
  machine::MachineOptions options;
  options.outputs.resize(1);
  options.outputs[0].name = "pen";
  options.outputs[0].line = "GPIO1";
  options.inputs.resize(2);
  options.inputs[0].name = "probe";
  options.inputs[0].line.line = "gpiochip0:2";
  options.inputs[1].name = "button";
  options.inputs[1].line.line = "GPIO17";
  const LinesReport report = linesReport(twoChips(), linesOf({}, options));
  EXPECT_EQ(report.missing, 2U);
  EXPECT_EQ(report.text.rfind("  pin            line         found at     state\n"
                              "  outputs/pen    GPIO1        gpiochip0:1  free\n"
                              "  inputs/probe   gpiochip0:2  gpiochip0:2  held by \"gpioset\"\n"
                              "  inputs/button  GPIO17       not found\n",
                              0),
            0U)
      << report.text;
  EXPECT_TRUE(has(report.text, "  GPIO17: no chip has a line of that name.")) << report.text;
}

SystemFacts facts() {
  SystemFacts facts;
  facts.user = "me";
  facts.groups = {"me", "gpio"};
  facts.chips = {{"/dev/gpiochip0", "root", "gpio", 0660, true}};
  facts.rtprio = "50";
  facts.memlock = "unlimited";
  facts.rt_runtime_us = "950000";
  facts.rt_period_us = "1000000";
  facts.kernel = "6.1.0 #1";
  return facts;
}

TEST(PermissionsText, NamesTheRemedyOnlyWhereItIsNeeded) {
  EXPECT_EQ(permissionsText(facts()),
            "  user    me\n"
            "  groups  me gpio\n"
            "  /dev/gpiochip0  root:gpio  0660  may be used\n"
            "  config/udev/60-stepdriver-gpio.rules is not installed in /etc/udev/rules.d, and not "
            "needed\n");
  SystemFacts closed = facts();
  closed.chips[0].usable = false;
  EXPECT_TRUE(has(permissionsText(closed), "may not be used"));
  EXPECT_TRUE(has(permissionsText(closed), "usermod -aG gpio")) << permissionsText(closed);
}

TEST(LimitsText, TellsWhatWasGrantedAndWhatTheLimitsAre) {
  const std::string good = limitsText(facts(), {0, 0, 0});
  EXPECT_TRUE(has(good, "SCHED_FIFO 50; memory locked; processors kept awake")) << good;
  EXPECT_TRUE(has(good, "RLIMIT_RTPRIO         50\n")) << good;
  EXPECT_TRUE(has(good, "950000 of each 1000000 us")) << good;
  EXPECT_TRUE(has(good, "PREEMPT_RT            no\n")) << good;
  SystemFacts poor = facts();
  poor.rt_runtime_us = "-1";
  poor.preempt_rt = true;
  const std::string text = limitsText(poor, {EPERM, EPERM, EACCES});
  EXPECT_TRUE(has(text, "SCHED_FIFO refused")) << text;
  EXPECT_TRUE(has(text, "processors not kept awake")) << text;
  EXPECT_TRUE(has(text, "throttle              none")) << text;
  EXPECT_TRUE(has(text, "PREEMPT_RT            yes\n")) << text;
}

TEST(SystemFacts, AreThereOnAnyMachine) {
  const SystemFacts here = systemFacts();
  EXPECT_FALSE(here.user.empty());
  EXPECT_FALSE(here.groups.empty());
  EXPECT_FALSE(here.rtprio.empty());
  EXPECT_FALSE(here.kernel.empty());
}

TEST(RatesText, TellsAskedAndHeldRatesAndTheReason) {
  machine::StepRates rates;
  rates.axes.push_back({"x", 8000.0, 20'000.9, 10'000.0, "because", 3200.0});
  rates.axes.push_back({"y", 1e6, 20'000.0, 10'000.0, "so"});
  EXPECT_EQ(ratesText(rates),
            "  [steps/s]  needs    rpm  sustained alone  rpm  sustained with all  rpm\n"
            "  x          8000     150  20000            375  10000               187.5  ok\n"
            "  y          1000000  -    20000            -    10000               -      TOO FAST\n"
            "  What limits the rate with all axes moving:\n"
            "  x: because\n"
            "  y: so\n");
  EXPECT_EQ(tooFast(rates), "y");
}

TEST(MeasurementsText, IsInMicrosecondsAndDoesWithoutCalls) {
  pulse::Capability capability;
  capability.lateness = {1500, 2000, 3000, 4000, 300};
  config::AxisConfig x;
  x.name = "x";
  EXPECT_TRUE(
      has(measurementsText({x}, capability), "with spinning  1.50    2.00  3.00  4.00  300"));
  EXPECT_FALSE(has(measurementsText({x}, capability), "x/step"));
  capability.channels.push_back({{1000, 1100, 1200, 1300, 200}, {}});
  EXPECT_TRUE(has(measurementsText({x}, capability), "write of x/step"));
  EXPECT_FALSE(has(measurementsText({x}, capability), "endstop"));
}

TEST(Options, AreReadAndRefused) {
  const Options options = parseOptions({"--config", "a.yaml", "--backend", "libgpiod", "--move",
                                        "--axis", "x", "--distance", "-2.5"});
  EXPECT_EQ(options.config, "a.yaml");
  EXPECT_EQ(options.backend, BackendChoice::kLibgpiod);
  EXPECT_TRUE(options.move);
  EXPECT_EQ(options.axis, "x");
  EXPECT_EQ(options.distance, -2.5);
  EXPECT_TRUE(parseOptions({"--help"}).help);
  for (const std::vector<std::string>& wrong :
       std::vector<std::vector<std::string>>{{},
                                             {"--config"},
                                             {"--config", "a", "--backend", "gpio"},
                                             {"--config", "a", "--distance", "1"},
                                             {"--config", "a", "--axis", "x"},
                                             {"--config", "a", "--move", "--distance", "0"},
                                             {"--config", "a", "--move", "--distance", "far"},
                                             {"--config", "a", "--move", "--distance", "nan"},
                                             {"--config", "a", "b"}}) {
    EXPECT_THROW(parseOptions(wrong), Error);
  }
}

TEST(StartFor, AStrokeKeepsItWithinTheSoftLimits) {
  config::AxisConfig config;
  EXPECT_EQ(startFor(config, 1.0), 0.0);
  config.min_position = 0.0;
  config.max_position = 10.0;
  EXPECT_EQ(startFor(config, 1.0), 0.0);
  EXPECT_EQ(startFor(config, -1.0), 1.0);
  config.min_position = 5.0;
  EXPECT_EQ(startFor(config, 1.0), 5.0);
  config.min_position = -10.0;
  config.max_position = -2.0;
  EXPECT_EQ(startFor(config, 1.0), -3.0);
}

}  // namespace
}  // namespace stepdriver::check
