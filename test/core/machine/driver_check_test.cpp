#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "stepdriver_core/setup/hardware.h"
#include "support/bench.h"
#include "support/tmc_axis.h"

namespace stepdriver {
namespace {

using test::Bench;
using test::tmcAxis;

class DriverCheckTest : public testing::Test {
 protected:
  using Change = std::function<void(std::vector<sim::RigAxisSpec>& rig)>;

  // The axes are wired on the rig as they are configured, except for this change.
  std::string check(const Change& change = {}, bool wiring = true) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes_);
    if (change) change(specs);
    sim::Rig rig(specs);
    gpio::SimulatedBackend backend(rig, [] { return std::int64_t{0}; });
    std::string wrong;
    count_ = 0;
    for (const setup::DriverFinding& finding : setup::checkDrivers(axes_, backend, wiring)) {
      ++count_;
      last_ = finding.text;
      if (!finding.is_right) wrong += finding.text + "\n";
    }
    for (const sim::RigAxisSpec& spec : specs) {
      EXPECT_EQ(rig.report(spec.name).carriage, 0.0) << "nothing may move";
    }
    return wrong;
  }

  std::vector<config::AxisConfig> axes_{tmcAxis("x", 0), tmcAxis("y", 1)};
  int count_ = 0;
  std::string last_;
};

TEST_F(DriverCheckTest, FindsNothingWrongIfAllIsRight) {
  EXPECT_EQ(check(), "");
  EXPECT_EQ(count_, 2 + 2 * 3);
  axes_[0].pins.dir.inverted = axes_[0].pins.step.inverted = true;
  axes_[1].pins.enable.inverted = true;
  EXPECT_EQ(check(), "");
  // One line for the ENABLE of both.
  axes_[1].pins.enable = axes_[0].pins.enable;
  EXPECT_EQ(check(), "");
  EXPECT_EQ(check({}, false), "");
  EXPECT_EQ(count_, 2);
}

TEST_F(DriverCheckTest, TellsHowSlowAPortIs) {
  for (const int baud : {9600, 19'200, 115'200}) {
    axes_ = {tmcAxis("x", 0), tmcAxis("y", 1), tmcAxis("z", 2), tmcAxis("a", 3)};
    for (config::AxisConfig& axis : axes_) axis.tmc->baud = baud;
    EXPECT_EQ(check({}, false), "");
    EXPECT_EQ(last_.find("asking its 4 drivers how they are takes 0.36 s") != std::string::npos,
              baud == 9600)
        << last_;
  }
}

TEST_F(DriverCheckTest, FindsStepAndDirSwapped) {
  EXPECT_EQ(check([](auto& rig) { std::swap(rig[0].step, rig[0].dir); }),
            "x: pins/step (x.step) reaches DIR instead of STEP: exchange the wires, or the lines "
            "in the configuration\n"
            "x: pins/dir (x.dir) reaches STEP instead of DIR: exchange the wires, or the lines in "
            "the configuration\n");
}

TEST_F(DriverCheckTest, FindsTheWiresOfTwoDriversSwapped) {
  const std::string wrong = check([](auto& rig) { std::swap(rig[0].step, rig[1].step); });
  EXPECT_NE(wrong.find("x: pins/step (x.step) reaches STEP of y instead of STEP"),
            std::string::npos)
      << wrong;
  EXPECT_NE(wrong.find("y: pins/step (y.step) reaches STEP of x instead of STEP"),
            std::string::npos)
      << wrong;
}

TEST_F(DriverCheckTest, FindsBrokenInvertedAndTouchingWires) {
  EXPECT_EQ(check([](auto& rig) { rig[1].enable.line = "elsewhere"; }),
            "y: pins/enable (y.enable) doesn't reach ENN: its wire is broken, or it is another "
            "line\n");
  EXPECT_EQ(check([](auto& rig) { rig[0].dir.inverted = true; }),
            "x: pins/dir (x.dir) reaches DIR inverted: set invert for it\n");
  const std::string touching = check([](auto& rig) { rig[0].dir.line = rig[0].step.line; });
  EXPECT_NE(touching.find("x: pins/step (x.step) reaches STEP, but DIR as well: two wires touch"),
            std::string::npos)
      << touching;
}

TEST_F(DriverCheckTest, FindsAWrongAddressAndAnotherChip) {
  EXPECT_EQ(check([](auto& rig) { rig[0].tmc->address = 3; }, false),
            "x: the TMC2209 on /dev/serial0 at address 0, no chip answers: it has no motor supply, "
            "or another address (MS1, MS2), or PDN_UART isn't connected, or it can't measure this "
            "baud rate; but a chip answers at address 3\n");
  const std::string other = check([](auto& rig) { rig[0].tmc->version = 0x20; });
  EXPECT_NE(other.find("says that it is a TMC2208"), std::string::npos) << other;
  EXPECT_NE(other.find("the lines weren't tested"), std::string::npos) << other;
}

TEST_F(DriverCheckTest, NamesAPortThatIsMissing) {
  for (config::AxisConfig& axis : axes_) axis.tmc->port = "/dev/there/is/none";
  const std::string wrong = check([](auto& rig) {
    for (auto& spec : rig) spec.tmc.reset();
  });
  EXPECT_NE(wrong.find("/dev/there/is/none can't be opened: there is no such device"),
            std::string::npos)
      << wrong;
}

}  // namespace
}  // namespace stepdriver
