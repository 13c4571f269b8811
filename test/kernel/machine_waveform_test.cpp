#include "machine_waveform.h"

#include <gtest/gtest.h>

#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"

// Tests moves from rest to rest: every pulse goes out, in its direction and at its time.

namespace stepdriver::kernel {
namespace {

using axis::MoveEnd;

// ---- back and forth: every driver, plain and inverted, on one chip and on two ----

struct Wiring {
  const char* name;
  std::string driver;
  Place place;
  std::optional<driver::Timing> timing = {};  // no value: the driver's own
};

/// So slow that each required time is longer than the time that passes anyway.
driver::Timing slowOptos() {
  driver::Timing timing = driver::driverChip("tb6600").timing;
  timing.step_high_ns = 150'000;
  timing.step_low_ns = 330'000;
  timing.dir_setup_ns = timing.dir_hold_ns = 480'000;
  return timing;
}

void PrintTo(const Wiring& wiring, std::ostream* out) {  // NOLINT: GoogleTest's name
  *out << wiring.name;
}

class OneAxis : public MachineWaveform, public testing::WithParamInterface<Wiring> {};

TEST_P(OneAxis, MovesBackAndForthAsPlanned) {
  auto config = axisAt("x", GetParam().driver, GetParam().place);
  config.driver.timing = GetParam().timing.value_or(config.driver.timing);
  const std::vector<config::AxisConfig> axes = {config};
  KernelBench bench(axes);
  const Moves moves = {600, -1'000, 1, -1, 500, -100};
  for (const std::int64_t move : moves) {
    axis::Axis& x = bench.axis("x");
    EXPECT_EQ(x.wait(bench.start("x", move)).end, MoveEnd::kReached);
  }
  const auto seen = read(bench, axes);
  expectAsPlanned(seen.at("x"), moves, axes[0]);
}

INSTANTIATE_TEST_SUITE_P(
    On, OneAxis,
    testing::Values(Wiring{"A4988", "a4988", placeAt("board-0", 0)},
                    Wiring{"Drv8825", "drv8825", placeAt("board-1", 4)},
                    Wiring{"Tb6600WithSlowOptos", "tb6600", placeAt("board-0", 0), slowOptos()},
                    Wiring{"Tb6600CommonAnode", "tb6600", placeAt("board-0", 1, true)},
                    Wiring{"A4988DirInverted",
                           "a4988",
                           {{"board-0:3", false}, {"board-0:2", true}, {"board-0:1", false}}},
                    Wiring{"Drv8825StepInvertedDirOnTheOtherChip",
                           "drv8825",
                           {{"board-1:0", true}, {"board-0:0", false}, {"board-0:1", true}}},
                    Wiring{"A4988EnableOnTheOtherChip",
                           "a4988",
                           {{"board-0:0", false}, {"board-0:1", false}, {"board-1:1", false}}}),
    [](const auto& kind) { return kind.param.name; });

// ---- two axes ----

class TwoAxes : public MachineWaveform {
 protected:
  void moveBoth(const std::vector<config::AxisConfig>& axes) {
    KernelBench bench(axes);
    const Moves moves_x = {800, -800, 300};
    const Moves moves_y = {-500, 900, -400};
    for (std::size_t i = 0; i < moves_x.size(); ++i) {
      const axis::Move x = bench.start("x", moves_x[i]);
      const axis::Move y = bench.start("y", moves_y[i]);
      EXPECT_EQ(bench.axis("x").wait(x).end, MoveEnd::kReached);
      EXPECT_EQ(bench.axis("y").wait(y).end, MoveEnd::kReached);
    }
    const auto seen = read(bench, axes);
    expectAsPlanned(seen.at("x"), moves_x, axes[0]);
    expectAsPlanned(seen.at("y"), moves_y, axes[1]);
  }
};

TEST_F(TwoAxes, MoveAtOnceOnOneChip) {
  moveBoth({axisAt("x", "a4988", placeAt("board-0", 0)),
            axisAt("y", "tb6600", placeAt("board-0", 4, true))});
}

TEST_F(TwoAxes, MoveAtOnceOnTwoChips) {
  moveBoth(
      {axisAt("x", "drv8825", placeAt("board-0", 0)), axisAt("y", "a4988", placeAt("board-1", 0))});
}

TEST_F(TwoAxes, MoveAtOnceWithTheirPinsSpreadOverBothChips) {
  moveBoth(
      {axisAt("x", "tb6600", {{"board-0:0", false}, {"board-1:0", true}, {"board-1:1", false}}),
       axisAt("y", "drv8825", {{"board-1:4", true}, {"board-0:4", false}, {"board-0:5", false}})});
}

}  // namespace
}  // namespace stepdriver::kernel
