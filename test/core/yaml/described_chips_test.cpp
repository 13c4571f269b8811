// Drivers that exist only as YAML, on the rig. With STEPDRIVER_EDGES=100000000 in the environment,
// as many edges of STEP are checked.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "config/config_reader.h"
#include "stepdriver_core/yaml.h"
#include "support/bench.h"
#include "support/config_map.h"

namespace stepdriver::yaml {
namespace {

/// Each has something that no other has: inverted levels, codes of one, two and three pins, sleep
/// that keeps the translator, disabling that takes it home, switches, CW and CCW inputs with an
/// in-position output, steps on both edges.
constexpr const char* kDrivers = R"(
one_mode_pin:
  driver: step_dir
  pins: {step: a.step, dir: a.dir, enable: a.enable, ms1: a.ms1}
  chip: {enable_active: high, microstep_codes: "16 L, 32 H"}
  timing: {step_high_us: 1.0, step_low_us: 1.5, dir_setup_us: 0.7, dir_hold_us: 0.4,
           mode_setup_us: 0.9, mode_hold_us: 2.0, enable_ms: 3.0}
  microsteps: 16
  align_on_microstep_change: true
  steps_per_mm: 80.0
  max_speed_mm_s: 200.0
  acceleration_mm_s2: 5000.0
two_mode_pins:
  driver: step_dir
  pins: {step: b.step, dir: b.dir, enable: b.enable, m0: b.m0, m1: b.m1, sleep: b.sleep}
  chip: {enable_active: low, sleep_active: high, when_asleep: held,
         microstep_codes: "1 LL, 4 HL, 8 HH, 16 LH"}
  timing: {step_high_us: 2.0, step_low_us: 2.0, dir_setup_us: 5.0, dir_hold_us: 5.0,
           mode_setup_us: 1.0, mode_hold_us: 1.0, enable_ms: 0.5, wake_ms: 1.0}
  microsteps: 8
  align_on_microstep_change: true
  steps_per_mm: 40.0
  max_speed_mm_s: 200.0
  acceleration_mm_s2: 8000.0
three_mode_pins:
  driver: step_dir
  pins: {step: c.step, dir: c.dir, enable: c.enable, ms1: c.ms1, ms2: c.ms2, ms3: c.ms3,
         sleep: c.sleep, reset: c.reset}
  invert: {step: true, ms2: true, reset: true}
  chip: {enable_active: low, sleep_active: low, reset_active: high,
         microstep_codes: "2 HLL, 4 LLL, 16 LLH, 16 LHH, 5 LHL"}
  timing: {step_high_us: 0.5, step_low_us: 0.5, dir_setup_us: 0.1, dir_hold_us: 0.1,
           mode_setup_us: 0.2, mode_hold_us: 0.2, enable_ms: 0.0, wake_ms: 2.0,
           reset_low_ms: 0.1, reset_wait_ms: 0.5}
  microsteps: 16
  align_on_microstep_change: true
  steps_per_mm: 160.0
  max_speed_mm_s: 250.0
  acceleration_mm_s2: 9000.0
active_low_step:
  driver: step_dir
  pins: {step: d.step, dir: d.dir, enable: d.enable}
  chip: {step_active: low, enable_active: high, when_disabled: home}
  timing: {step_high_us: 10.0, step_low_us: 10.0, dir_setup_us: 20.0, dir_hold_us: 15.0,
           enable_ms: 100.0}
  microsteps: 25
  steps_per_mm: 50.0
  max_speed_mm_s: 300.0
  acceleration_mm_s2: 3000.0
common_anode_box:
  driver: step_dir
  pins: {step: e.step, dir: e.dir, enable: e.enable}
  common_anode: true
  chip: {enable_active: low, when_disabled: counts}
  timing: {step_high_us: 4.0, step_low_us: 4.0, dir_setup_us: 8.0, dir_hold_us: 3.0,
           enable_ms: 20.0}
  microsteps: 125
  steps_per_mm: 100.0
  max_speed_mm_s: 400.0
  acceleration_mm_s2: 9000.0
cw_ccw_box:
  driver: step_dir
  pins: {cw: f.cw, ccw: f.ccw, enable: f.enable, in_position: f.pend, fault: f.alarm}
  chip: {step_inputs: cw_ccw, enable_active: low, in_position_active: low, fault_active: high,
         fault_ended_by: power}
  timing: {step_high_us: 3.0, step_low_us: 2.0, dir_setup_us: 30.0, dir_hold_us: 10.0,
           enable_ms: 5.0}
  microsteps: 50
  steps_per_mm: 90.0
  max_speed_mm_s: 300.0
  acceleration_mm_s2: 7000.0
both_edges:
  driver: step_dir
  pins: {step: g.step, dir: g.dir, enable: g.enable}
  chip: {step_edges: both, enable_active: low}
  timing: {step_high_us: 4.0, step_low_us: 6.0, dir_setup_us: 7.0, dir_hold_us: 3.0,
           enable_ms: 1.0}
  microsteps: 64
  steps_per_mm: 70.0
  max_speed_mm_s: 300.0
  acceleration_mm_s2: 7000.0
)";

std::vector<config::AxisConfig> describedAxes() {
  const config::ConfigValue axes = parse(kDrivers, "drivers");
  std::vector<ConfigIssue> issues;
  std::vector<config::AxisConfig> configs = config::readAxes(axes, "/axes", issues);
  EXPECT_EQ(config::linesOf(issues), std::vector<std::string>{});
  return configs;
}

std::int64_t wantedEdges() {
  const char* const edges = std::getenv("STEPDRIVER_EDGES");
  return edges != nullptr ? std::atoll(edges) : 1'000'000;
}

/// Random commands for all axes, one after another.
class DescribedChips : public testing::Test {
 protected:
  DescribedChips()
      : configs_(describedAxes()),
        rig_(test::Bench::rigAxes(configs_)),
        backend_(rig_, [this] { return clock_.now(); }),
        machine_(configs_, backend_, clock_) {}

  std::int64_t edges() const {
    std::int64_t edges = 0;
    for (const config::AxisConfig& config : configs_) {
      const sim::RigAxisReport report = rig_.report(config.name);
      const std::int64_t pulses = report.pulses_forward + report.pulses_backward;
      edges += config.driver.both_edges ? pulses : 2 * pulses;
    }
    return edges;
  }

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }

  void command(const config::AxisConfig& config) {
    axis::Axis& axis = machine_.axis(config.name);
    if (chance(0.1)) {
      axis.enable(false);
      axis.enable(true);
    }
    if (config.pins.sleep.wired() && chance(0.1)) {
      axis.sleep(true);
      axis.sleep(false);
    }
    if (config.pins.ms1.wired() && chance(0.3)) {
      const std::vector<int> modes = driver::selectableMicrosteps(config.driver);
      axis.setMicrosteps(
          modes[static_cast<std::size_t>(uniform(0.0, 0.999) * static_cast<double>(modes.size()))]);
    }
    const axis::MoveResult result = axis.wait(axis.moveTo(uniform(-0.05, 0.05)));
    EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
  }

  std::mt19937_64 random_{20261122};
  const std::vector<config::AxisConfig> configs_;
  pulse::VirtualClock clock_{0.0};
  mutable sim::Rig rig_;
  gpio::SimulatedBackend backend_;
  test::UnthreadedMachine machine_;
};

TEST_F(DescribedChips, SeeNoViolationInManyEdges) {
  const std::int64_t wanted = wantedEdges();
  for (const config::AxisConfig& config : configs_) machine_.axis(config.name).enable(true);
  while (edges() < wanted && !HasFailure()) {
    for (const config::AxisConfig& config : configs_) command(config);
  }
  for (const config::AxisConfig& config : configs_) {
    const sim::RigAxisReport report = rig_.report(config.name);
    EXPECT_EQ(report.totalViolations(), 0) << config.name << ": " << test::violationsOf(report);
    EXPECT_GT(report.pulses_forward, wanted / 500) << config.name;
    EXPECT_GT(report.pulses_backward, wanted / 500) << config.name;
  }
  std::printf("%lld edges of STEP\n", static_cast<long long>(edges()));
}

}  // namespace
}  // namespace stepdriver::yaml
