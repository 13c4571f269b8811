#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "kernel_bench.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/pulse/clock.h"
#include "support/test_board.h"
#include "waveform.h"

// What the kernel's lines did while whole machines moved, held against the plan and the chips.
//
// On a machine that stalls pulses come late: then later ones do, too, but they come never closer
// than three quarters of their planned interval, and none is left out.

namespace stepdriver::kernel {
namespace {

using axis::MoveEnd;

/// Of a planned interval; see docs/design.md.
constexpr double kClosest = 0.75;

std::int64_t closest(std::int64_t interval) {
  return static_cast<std::int64_t>(kClosest * static_cast<double>(interval));
}

/// What all tests have read.
struct Totals {
  std::size_t edges = 0;
  std::size_t pulses = 0;
  std::size_t violations = 0;
  std::uint64_t slips = 0;
};

Totals& totals() {
  static Totals all;
  return all;
}

class Summary : public testing::Environment {
 public:
  void TearDown() override {
    const Totals& all = totals();
    if (all.pulses == 0) return;
    std::printf(
        "[ KERNEL   ] %zu edges read from the kernel, %zu pulses, %zu violations; the "
        "timeline slid %llu times\n",
        all.edges, all.pulses, all.violations, static_cast<unsigned long long>(all.slips));
  }
};

const testing::Environment* const kSummary =
    testing::AddGlobalTestEnvironment(new Summary);  // NOLINT: GoogleTest deletes it

class MachineWaveform : public testing::Test {
 protected:
  void SetUp() override {
    const std::string missing = test::gpioSimBoard().missing();
    if (!missing.empty()) GTEST_SKIP() << missing;
  }

  static std::string nameOfTest() {
    std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
    std::replace(name.begin(), name.end(), '/', '-');
    return name;
  }

  /// Ends the machine, reads the lines of its axes, and expects what holds for every machine.
  std::map<std::string, Waveform> read(KernelBench& bench,
                                       const std::vector<axis::AxisConfig>& axes) {
    std::map<std::string, std::int64_t> counts;
    for (const axis::AxisConfig& config : axes) counts[config.name] = bench.count(config.name);
    const machine::EngineFigures figures = bench.figures();
    trace = std::make_unique<KernelTrace>(bench.finish(nameOfTest()));

    std::map<std::string, Waveform> waveforms;
    std::size_t pulses = 0;
    for (const axis::AxisConfig& config : axes) {
      WiredAxis wired = wiredAxis(config, *trace);
      wired.shortest_interval_ns =
          closest(static_cast<std::int64_t>(1e9 / (config.max_speed * config.steps_per_unit)));
      const Waveform& seen = waveforms[config.name] = waveformOf(*trace, wired);
      EXPECT_TRUE(seen.violations.empty()) << config.name << ":\n" << reportOf(seen);
      EXPECT_EQ(seen.position(), counts[config.name]) << config.name;
      pulses += seen.pulses.size();
      totals().edges += seen.edges;
      totals().violations += seen.violations.size();
    }
    EXPECT_EQ(pulses, figures.pulses);
    totals().pulses += pulses;
    totals().slips += figures.slips;
    return waveforms;
  }

  std::unique_ptr<KernelTrace> trace;
};

/// Holds pulses against the steps that were planned for them, as far as both go.
///
/// The timeline may only slide to later: what a pulse is late by is made up for by at most the part
/// of the next interval that kClosest leaves.
void expectAsPlanned(const std::vector<Pulse>& pulses, std::size_t first,
                     const std::vector<motion::Step>& steps, std::size_t count) {
  ASSERT_LE(count, steps.size());
  ASSERT_LE(first + count, pulses.size());
  std::int64_t timeline = 0;  // the earliest that the plan's time 0 can be, as seen so far
  for (std::size_t k = 0; k < count; ++k) {
    const Pulse& pulse = pulses[first + k];
    ASSERT_EQ(pulse.forward, steps[k].direction > 0) << "step " << k;
    ASSERT_GE(pulse.time_ns, timeline + steps[k].time_ns) << "step " << k << " came too early";
    if (k + 1 == count) break;
    const std::int64_t interval = steps[k + 1].time_ns - steps[k].time_ns;
    const std::int64_t made_up = interval - closest(interval);
    timeline = std::max(timeline, pulse.time_ns - steps[k].time_ns - made_up);
  }
}

/// Moves by microsteps, one after the other, and what the pulses of all of them must be.
using Moves = std::vector<std::int64_t>;

void expectAsPlanned(const Waveform& seen, const Moves& moves, const axis::AxisConfig& config) {
  std::int64_t position = 0;
  std::size_t first = 0;
  for (const std::int64_t move : moves) {
    SCOPED_TRACE(config.name + ", move from " + std::to_string(position) + " by " +
                 std::to_string(move));
    const auto steps = plannedSteps(position, position + move, limitsOf(config));
    ASSERT_EQ(steps.size(), static_cast<std::size_t>(std::abs(move)));
    ASSERT_NO_FATAL_FAILURE(expectAsPlanned(seen.pulses, first, steps, steps.size()));
    position += move;
    first += steps.size();
  }
  EXPECT_EQ(seen.pulses.size(), first) << config.name;
}

Place placeAt(const std::string& chip, unsigned first, bool inverted = false) {
  const auto pin = [&](unsigned offset) {
    return axis::Pin{chip + ":" + std::to_string(first + offset), inverted};
  };
  return {pin(0), pin(1), pin(2)};
}

// ---- back and forth: every driver, plain and inverted, on one chip and on two ----

struct Wiring {
  const char* name;
  chip::Model driver;
  Place place;
  std::optional<chip::Timing> timing = {};  // none: the driver's own
};

/// So slow that every time that it needs is longer than what comes by itself.
chip::Timing slowOptos() {
  chip::Timing timing = chip::chipOf(chip::Model::kTb6600).timing;
  timing.step_high_ns = 150'000;
  timing.step_low_ns = 330'000;
  timing.dir_setup_ns = timing.dir_hold_ns = 40'000'000;
  return timing;
}

void PrintTo(const Wiring& wiring, std::ostream* out) {  // NOLINT: GoogleTest's name
  *out << wiring.name;
}

class OneAxis : public MachineWaveform, public testing::WithParamInterface<Wiring> {};

TEST_P(OneAxis, MovesBackAndForthAsPlanned) {
  auto config = axisAt("x", GetParam().driver, GetParam().place);
  config.timing = GetParam().timing.value_or(config.timing);
  const std::vector<axis::AxisConfig> axes = {config};
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
    testing::Values(Wiring{"A4988", chip::Model::kA4988, placeAt("board-0", 0)},
                    Wiring{"Drv8825", chip::Model::kDrv8825, placeAt("board-1", 4)},
                    Wiring{"Tb6600WithSlowOptos", chip::Model::kTb6600, placeAt("board-0", 0),
                           slowOptos()},
                    Wiring{"Tb6600CommonAnode", chip::Model::kTb6600, placeAt("board-0", 1, true)},
                    Wiring{"A4988DirInverted",
                           chip::Model::kA4988,
                           {{"board-0:3", false}, {"board-0:2", true}, {"board-0:1", false}}},
                    Wiring{"Drv8825StepInvertedDirOnTheOtherChip",
                           chip::Model::kDrv8825,
                           {{"board-1:0", true}, {"board-0:0", false}, {"board-0:1", true}}},
                    Wiring{"A4988EnableOnTheOtherChip",
                           chip::Model::kA4988,
                           {{"board-0:0", false}, {"board-0:1", false}, {"board-1:1", false}}}),
    [](const auto& kind) { return kind.param.name; });

// ---- two axes ----

class TwoAxes : public MachineWaveform {
 protected:
  void moveBoth(const std::vector<axis::AxisConfig>& axes) {
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
  moveBoth({axisAt("x", chip::Model::kA4988, placeAt("board-0", 0)),
            axisAt("y", chip::Model::kTb6600, placeAt("board-0", 4, true))});
}

TEST_F(TwoAxes, MoveAtOnceOnTwoChips) {
  moveBoth({axisAt("x", chip::Model::kDrv8825, placeAt("board-0", 0)),
            axisAt("y", chip::Model::kA4988, placeAt("board-1", 0))});
}

TEST_F(TwoAxes, MoveAtOnceWithTheirPinsSpreadOverBothChips) {
  moveBoth({axisAt("x", chip::Model::kTb6600,
                   {{"board-0:0", false}, {"board-1:0", true}, {"board-1:1", false}}),
            axisAt("y", chip::Model::kDrv8825,
                   {{"board-1:4", true}, {"board-0:4", false}, {"board-0:5", false}})});
}

// ---- ends in mid-move ----

class Ending : public MachineWaveform {};

constexpr std::int64_t kFar = 20'000;
constexpr std::int64_t kAbout = 800;

std::size_t pulsesBefore(const Waveform& seen, std::int64_t time_ns) {
  const auto& pulses = seen.pulses;
  return static_cast<std::size_t>(
      std::count_if(pulses.begin(), pulses.end(),
                    [time_ns](const Pulse& pulse) { return pulse.time_ns < time_ns; }));
}

TEST_F(Ending, ByAStopSlowsDownAsPlanned) {
  const std::vector<axis::AxisConfig> axes = {
      axisAt("x", chip::Model::kA4988, placeAt("board-0", 0))};
  KernelBench bench(axes);
  const axis::Move move = bench.start("x", kFar);
  bench.awaitCount("x", kAbout);
  const std::int64_t stopped_ns = pulse::SteadyClock().now();
  bench.axis("x").stop();
  EXPECT_EQ(bench.axis("x").wait(move).end, MoveEnd::kStopped);
  const Waveform seen = read(bench, axes).at("x");

  const motion::TrapezoidLimits limits = limitsOf(axes[0]);
  const std::size_t cruised = pulsesBefore(seen, stopped_ns);
  EXPECT_LT(seen.position(), kFar);
  EXPECT_EQ(seen.backward(), 0);
  expectAsPlanned(seen.pulses, 0, plannedSteps(0, kFar, limits), cruised);
  // The ramp down is one of the deceleration or a slower one.
  const auto ramp =
      static_cast<std::size_t>(limits.max_speed * limits.max_speed / (2.0 * limits.deceleration));
  ASSERT_GE(seen.pulses.size(), cruised + ramp);
  for (std::size_t left = 1; left < ramp; ++left) {
    const auto time = [&](double steps) { return std::sqrt(2.0 * steps / limits.deceleration); };
    const double planned = 1e9 * (time(left + 0.5) - time(left - 0.5));
    const std::size_t k = seen.pulses.size() - left;
    ASSERT_GE(seen.pulses[k].time_ns - seen.pulses[k - 1].time_ns,
              closest(static_cast<std::int64_t>(planned)))
        << left << " steps before the end";
  }
}

TEST_F(Ending, AtAnEndstopSendsNoStepAfterItReadsActive) {
  auto config = axisAt("x", chip::Model::kDrv8825, placeAt("board-0", 0));
  config.endstop_max = axis::Endstop{"board-1:3", true};
  const std::vector<axis::AxisConfig> axes = {config};
  KernelBench bench(axes);
  const axis::Move move = bench.start("x", kFar);
  bench.awaitCount("x", kAbout);
  bench.chip(1).drive(3, true);
  const std::int64_t pressed_ns = pulse::SteadyClock().now();
  EXPECT_EQ(bench.axis("x").wait(move).end, MoveEnd::kEndstopMax);
  const std::int64_t there = bench.count("x");
  EXPECT_EQ(bench.axis("x").wait(bench.start("x", -1'000)).end, MoveEnd::kReached);
  const Waveform seen = read(bench, axes).at("x");

  EXPECT_EQ(seen.forward(), there);
  EXPECT_EQ(seen.backward(), 1'000);
  const auto last = static_cast<std::size_t>(there);
  expectAsPlanned(seen.pulses, 0, plannedSteps(0, kFar, limitsOf(config)), last);
  EXPECT_LE(last, pulsesBefore(seen, pressed_ns) + 1) << "one may have been on its way";

  // Each step was preceded by a read of the switch of its own, which wasn't active.
  const unsigned endstop = trace->line("board-1:3");
  std::size_t next = 0;
  bool free = false;
  for (const LineEvent& event : trace->events()) {
    if (event.line == endstop && event.read) free = !event.level;
    if (next == last || event.time_ns != seen.pulses[next].time_ns) continue;
    ASSERT_TRUE(free) << "step " << next;
    free = false;
    ++next;
  }
  EXPECT_EQ(next, last);
}

TEST_F(Ending, ByAnEmergencyStopFinishesThePulse) {
  auto config_x = axisAt("x", chip::Model::kTb6600, placeAt("board-0", 0, true));
  config_x.timing.step_high_ns = 300'000;  // so long that most stops come while a pulse is out
  const std::vector<axis::AxisConfig> axes = {
      config_x, axisAt("y", chip::Model::kA4988, placeAt("board-1", 0))};
  KernelBench bench(axes);
  std::vector<std::int64_t> ends_x = {0};
  std::vector<std::int64_t> ends_y = {0};
  for (int i = 0; i < 6; ++i) {
    const axis::Move x = bench.start("x", kFar);
    const axis::Move y = bench.start("y", -kFar);
    bench.awaitCount("x", ends_x.back() + 150);
    bench.emergencyStop();
    EXPECT_EQ(bench.axis("x").wait(x).end, MoveEnd::kEmergencyStop);
    EXPECT_EQ(bench.axis("y").wait(y).end, MoveEnd::kEmergencyStop);
    EXPECT_TRUE(bench.awaitLevel(0, 0, true)) << "the pulse of x doesn't end";
    EXPECT_TRUE(bench.awaitLevel(1, 0, false)) << "the pulse of y doesn't end";
    ends_x.push_back(bench.count("x"));
    ends_y.push_back(bench.count("y"));
    bench.recover();
  }
  const auto seen = read(bench, axes);
  for (std::size_t i = 1; i < ends_x.size(); ++i) {
    SCOPED_TRACE("stop " + std::to_string(i));
    const auto hold = [&](const axis::AxisConfig& config, std::int64_t from, std::int64_t to,
                          std::int64_t far) {
      expectAsPlanned(seen.at(config.name).pulses, static_cast<std::size_t>(std::abs(from)),
                      plannedSteps(from, from + far, limitsOf(config)),
                      static_cast<std::size_t>(std::abs(to - from)));
    };
    hold(axes[0], ends_x[i - 1], ends_x[i], kFar);
    hold(axes[1], ends_y[i - 1], ends_y[i], -kFar);
  }
}

}  // namespace
}  // namespace stepdriver::kernel
