#include <gtest/gtest.h>

#include <cerrno>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using test::Bench;
using test::linearAxis;
using test::violationsOf;

/// Two axes with one ENABLE line, none enabled at the start.
std::vector<config::AxisConfig> sharingAxes() {
  std::vector<config::AxisConfig> axes = {linearAxis("x"), linearAxis("y", "drv8825")};
  for (config::AxisConfig& axis : axes) {
    axis.pins.enable.line = "both.enable";
    axis.enable_on_start = false;
  }
  return axes;
}

class SharedEnable : public testing::Test {
 protected:
  void make(const std::vector<config::AxisConfig>& axes) {
    bench = std::make_unique<Bench>(axes);
    for (const char* name : {"x", "y"}) bench->axis(name).setPosition(0.0);
  }

  void TearDown() override {
    EXPECT_EQ(violationsOf(bench->report("x")) + violationsOf(bench->report("y")), "");
  }

  axis::AxisState state(const std::string& name) { return bench->axis(name).state(); }
  bool energized() {
    EXPECT_EQ(bench->report("x").energized, bench->report("y").energized);
    return bench->report("x").energized;
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(SharedEnable, IsAssertedWhileAnyAxisWantsIt) {
  make(sharingAxes());
  EXPECT_FALSE(energized());
  bench->axis("x").enable(true);
  EXPECT_TRUE(energized());
  EXPECT_TRUE(state("x").enabled);
  EXPECT_FALSE(state("y").enabled);
  EXPECT_REFUSED(bench->axis("y").moveTo(0.001), "disabled");
  bench->axis("y").enable(true);
  bench->axis("x").enable(false);
  EXPECT_TRUE(energized());
  EXPECT_FALSE(state("x").enabled);
  EXPECT_TRUE(state("x").position_valid) << "its current holds it";
  EXPECT_REFUSED(bench->axis("x").moveTo(0.001), "disabled");
  EXPECT_EQ(bench->move(0.001, "y").end, axis::MoveEnd::kReached);
  bench->axis("y").enable(false);
  EXPECT_FALSE(energized());
  EXPECT_FALSE(state("x").position_valid) << "now nothing holds it";
  EXPECT_FALSE(state("y").position_valid);
}

TEST_F(SharedEnable, OutlivesAFaultAndAFailedWriteOfOne) {
  make(sharingAxes());
  bench->axis("x").enable(true);
  bench->axis("y").enable(true);
  bench->rig.failWrites("x.step", 100, EIO);
  EXPECT_EQ(bench->move(0.01, "x").end, axis::MoveEnd::kFault);
  EXPECT_TRUE(energized());
  bench->axis("x").enable(false);
  EXPECT_TRUE(energized());
  bench->rig.clearWriteFault("x.step");
  bench->machine->recover();
  EXPECT_TRUE(energized()) << "restoring the pins of x lets go of y";
  EXPECT_TRUE(state("y").position_valid);
  EXPECT_EQ(bench->move(0.001, "y").end, axis::MoveEnd::kReached);
  bench->rig.failWrites("both.enable", 0, EIO);
  EXPECT_THROW(bench->axis("y").enable(false), GpioError);
  EXPECT_TRUE(energized());
  EXPECT_TRUE(state("y").enabled);
  EXPECT_EQ(state("x").fault, "");
  bench->rig.clearWriteFault("both.enable");
}

TEST_F(SharedEnable, IsReleasedOnlyWhenAllAreIdle) {
  std::vector<config::AxisConfig> axes = sharingAxes();
  for (config::AxisConfig& axis : axes) {
    axis.idle_timeout = 1.0;
    axis.enable_on_start = true;
  }
  make(axes);
  bench->axis("y").moveTo(0.02, false, 0.01);  // 2 s
  bench->machine->advance(1.5);
  EXPECT_TRUE(state("x").idle);
  EXPECT_TRUE(state("x").position_valid);
  EXPECT_TRUE(energized());
  bench->machine->advance(2.0);
  EXPECT_TRUE(state("y").idle);
  EXPECT_FALSE(energized());
  EXPECT_FALSE(state("x").position_valid);
  EXPECT_EQ(bench->move(0.001, "x").end, axis::MoveEnd::kReached);
  EXPECT_TRUE(energized());
  EXPECT_TRUE(state("y").idle);
  EXPECT_EQ(bench->move(0.001, "y").end, axis::MoveEnd::kReached);
}

TEST_F(SharedEnable, IsKeptOverAShutdownForTheOneThatWantsIt) {
  for (const bool x_enabled : {true, false}) {
    std::vector<config::AxisConfig> axes = sharingAxes();
    axes[0].disable_on_shutdown = false;
    make(axes);
    bench->axis("x").enable(x_enabled);
    bench->axis("y").enable(true);
    bench->machine.reset();
    // The other pins of y's chip are its own: SLEEP and RESET are at their safe levels.
    EXPECT_EQ(bench->report("x").energized, x_enabled);
    EXPECT_FALSE(bench->report("y").energized);
  }
}

}  // namespace
}  // namespace stepdriver
