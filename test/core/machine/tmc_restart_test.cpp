#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <string>

#include "stepdriver_core/axis/axis.h"
#include "support/bench.h"
#include "support/contents_of.h"
#include "support/temporary_folder.h"
#include "support/tmc_axis.h"

// Positions that survive a restart because the driver has kept its power, and its count of steps.

namespace stepdriver {
namespace {

using test::Bench;
using test::tmcAxis;

// 80 microsteps/mm, 1/16: MSCNT comes back every 0.8 mm.
constexpr double kPlace = 0.00805;

class TmcRestart : public testing::Test {
 protected:
  TmcRestart() {
    config_.holds_position_unpowered = true;
    options_.state_file = folder_.path() + "/state";
  }
  ~TmcRestart() override { machine_.reset(); }

  void start() {
    if (rig_ == nullptr) {
      rig_ = std::make_unique<sim::Rig>(Bench::rigAxes({config_}));
      backend_ = std::make_unique<gpio::SimulatedBackend>(*rig_, [this] { return clock_.now(); });
    }
    machine_.reset();
    machine_ = std::make_unique<test::UnthreadedMachine>(std::vector<config::AxisConfig>{config_},
                                                         *backend_, clock_, options_);
  }
  axis::Axis& x() { return machine_->axis("x"); }
  void move(double position) {
    EXPECT_EQ(x().wait(x().moveTo(position)).end, axis::MoveEnd::kReached);
    machine_->advance(1.5);
  }
  std::string note() { return x().state().position_note; }

  config::AxisConfig config_ = tmcAxis();
  const test::TemporaryFolder folder_;
  machine::MachineOptions options_;
  pulse::VirtualClock clock_{0.0};
  std::unique_ptr<sim::Rig> rig_;
  std::unique_ptr<gpio::SimulatedBackend> backend_;
  std::unique_ptr<test::UnthreadedMachine> machine_;
};

TEST_F(TmcRestart, BringsAPositionBackIfTheDriverHasKeptItsPower) {
  start();
  x().setPosition(0.0);
  move(kPlace);
  for (int i = 0; i < 3; ++i) {
    start();
    EXPECT_EQ(note(), "");
    EXPECT_TRUE(x().state().position_valid);
    EXPECT_NEAR(x().state().position, kPlace, 1e-12);
    EXPECT_NEAR(rig_->report("x").carriage, 1e3 * kPlace, 1e-9);
  }
}

TEST_F(TmcRestart, DoesNotTrustAPositionIfTheDriverWasReset) {
  start();
  x().setPosition(0.0);
  move(kPlace);
  machine_.reset();
  rig_->brownOut("x");
  start();
  EXPECT_EQ(note(),
            "the chip was reset in between, which may have turned the motor by up to two full "
            "steps");
}

TEST_F(TmcRestart, DoesNotTrustAPositionIfTheDriverWasStepped) {
  start();
  x().setPosition(0.0);
  move(kPlace);
  const std::string file = options_.state_file;
  options_.state_file.clear();
  start();
  x().setPosition(0.0);
  move(0.0000625);
  options_.state_file = file;
  start();
  EXPECT_EQ(note(), "a driver has counted steps since it was kept");
  EXPECT_FALSE(x().state().position_valid);
}

TEST_F(TmcRestart, SaysAfterACrashWhetherTheDriverHasCountedSteps) {
  start();
  x().setPosition(0.0);
  move(kPlace);
  const std::string kept = test::contentsOf(options_.state_file);
  const auto crash = [&] {
    machine_.reset();
    std::ofstream(options_.state_file) << kept;
  };
  crash();
  start();
  EXPECT_EQ(note(),
            "the node that kept this position wasn't shut down; no driver has counted a step "
            "since");
  EXPECT_FALSE(x().state().position_valid);
  x().setPosition(kPlace);
  move(kPlace + 0.0001);
  crash();
  start();
  EXPECT_EQ(note(),
            "the node that kept this position wasn't shut down, and a driver has counted steps "
            "since");
}

// A chip whose DIR is inverted counts against the axis: its home isn't where the same number of
// steps in the other direction would lead.
TEST_F(TmcRestart, KnowsTheHomeOfADriverThatCountsBackward) {
  config_.pins.dir.inverted = true;
  start();
  x().setPosition(0.0);
  move(0.0000125);
  start();
  EXPECT_TRUE(x().state().position_valid) << note();
  move(0.000025);
  machine_.reset();
  rig_->brownOut("x");
  start();
  EXPECT_EQ(note(),
            "the chip was reset in between, which may have turned the motor by up to two full "
            "steps");
}

}  // namespace
}  // namespace stepdriver
