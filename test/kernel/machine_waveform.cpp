#include "machine_waveform.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "support/test_board.h"

namespace stepdriver::kernel {
namespace {

/// Summary of everything that the tests have read.
struct Totals {
  std::size_t edges = 0;
  std::size_t pulses = 0;
  std::size_t violations = 0;
  std::uint64_t slips = 0;
  MotorView motors;
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
        "timeline slid %llu times; rotors lagged by up to %.1f electrical degrees and lost %lld "
        "steps\n",
        all.edges, all.pulses, all.violations, static_cast<unsigned long long>(all.slips),
        all.motors.largest_lag_degrees, static_cast<long long>(all.motors.lost_steps));
  }
};

const testing::Environment* const kSummary =
    testing::AddGlobalTestEnvironment(new Summary);  // NOLINT: GoogleTest deletes it

void noteMotor(const MotorView& motor) {
  MotorView& all = totals().motors;
  all.largest_lag_degrees = std::max(all.largest_lag_degrees, motor.largest_lag_degrees);
  all.lost_steps += motor.lost_steps;
}

std::string nameOfTest() {
  std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
  std::replace(name.begin(), name.end(), '/', '-');
  return name;
}

}  // namespace

std::int64_t madeUp(std::int64_t planned_interval) {
  return std::max<std::int64_t>(planned_interval / 4,
                                std::min<std::int64_t>(planned_interval * 32 / 4, 2'000'000));
}

Place placeAt(const std::string& chip, unsigned first, bool inverted) {
  const auto pin = [&](unsigned offset) {
    return config::Pin{chip + ":" + std::to_string(first + offset), inverted};
  };
  return {pin(0), pin(1), pin(2)};
}

void MachineWaveform::SetUp() {
  const std::string missing = test::gpioSimBoard().missing();
  if (!missing.empty()) GTEST_SKIP() << missing;
}

std::map<std::string, Waveform> MachineWaveform::read(KernelBench& bench,
                                                      const std::vector<config::AxisConfig>& axes) {
  std::map<std::string, std::int64_t> counts;
  for (const config::AxisConfig& config : axes) counts[config.name] = bench.count(config.name);
  const machine::EngineFigures figures = bench.figures();
  trace = std::make_unique<KernelTrace>(bench.finish(nameOfTest()));

  std::map<std::string, Waveform> waveforms;
  std::size_t pulses = 0;
  for (const config::AxisConfig& config : axes) {
    const Waveform& seen = waveforms[config.name] = waveformOf(*trace, wiredAxis(config, *trace));
    EXPECT_TRUE(seen.violations.empty()) << config.name << ":\n" << reportOf(seen);
    EXPECT_EQ(seen.position(), counts[config.name]) << config.name;
    pulses += seen.pulses.size();
    totals().edges += seen.edges;
    totals().violations += seen.violations.size();
    noteMotor(motorViewOf(seen.pulses, config.microsteps));
  }
  EXPECT_EQ(pulses, figures.pulses);
  totals().pulses += pulses;
  totals().slips += figures.slips;
  return waveforms;
}

void expectAsPlanned(const std::vector<Pulse>& pulses, std::size_t first,
                     const std::vector<motion::Step>& steps, std::size_t count) {
  ASSERT_LE(count, steps.size());
  ASSERT_LE(first + count, pulses.size());
  std::int64_t timeline = 0;  // the earliest possible time 0 of the plan, as seen so far
  for (std::size_t k = 0; k < count; ++k) {
    const Pulse& pulse = pulses[first + k];
    ASSERT_EQ(pulse.forward, steps[k].direction > 0) << "step " << k;
    ASSERT_GE(pulse.time_ns, timeline + steps[k].time_ns) << "step " << k << " came too early";
    if (k + 1 == count) break;
    // A late step makes up for a part of the longer one of the intervals before and after it. The
    // interval before the first step begins with the plan.
    const std::int64_t before = steps[k].time_ns - (k > 0 ? steps[k - 1].time_ns : 0);
    const std::int64_t interval = std::max(before, steps[k + 1].time_ns - steps[k].time_ns);
    timeline = std::max(timeline, pulse.time_ns - steps[k].time_ns - madeUp(interval));
  }
}

void expectAsPlanned(const Waveform& seen, const Moves& moves, const config::AxisConfig& config) {
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

}  // namespace stepdriver::kernel
