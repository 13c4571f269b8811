// Motors of phases on the rig: its motor follows the patterns of the coils.
#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {
namespace {

constexpr std::int64_t kMs = 1'000'000;

class RigPhases : public testing::Test {
 protected:
  explicit RigPhases(int microsteps = 2)
      : rig({spec(microsteps)}), backend(rig, [this] { return time; }) {
    request();
  }

  static RigAxisSpec spec(int microsteps) {
    RigAxisSpec x;
    x.name = "x";
    x.chip = driver::driverChip("uln2003");
    x.in1.line = "A";
    x.in2.line = "B";
    x.in3.line = "C";
    x.in4.line = "D";
    x.microsteps = microsteps;
    x.full_step_travel = 2.0;
    return x;
  }

  void request() {
    lines = backend.request(
        {{"A", false, false}, {"B", false, false}, {"C", false, false}, {"D", false, false}}, {});
  }

  /// One write of all coils, 20 ms after the last one.
  void set(driver::CoilSet coils) {
    time += 20 * kMs;
    std::vector<gpio::LineWrite> writes;
    for (int i = 0; i < 4; ++i) writes.push_back({i, (coils & (1 << i)) != 0});
    ASSERT_EQ(lines->write(writes.data(), writes.size()), 0);
  }

  std::int64_t count(Violation violation) const {
    const RigAxisReport report = rig.report("x");
    const auto found = report.violations.find(violation);
    return found == report.violations.end() ? 0 : found->second;
  }
  std::int64_t total() const { return rig.report("x").totalViolations(); }

  std::int64_t time = 0;
  Rig rig;
  gpio::SimulatedBackend backend;
  std::unique_ptr<gpio::Lines> lines;
};

TEST_F(RigPhases, FollowsTheHalfSteps) {
  EXPECT_FALSE(rig.report("x").energized);
  set(0b0011);
  EXPECT_TRUE(rig.report("x").energized);
  for (int i = 1; i <= 8; ++i) {
    set(driver::kHalfSteps.at(static_cast<std::size_t>(i % 8)));
    EXPECT_EQ(rig.report("x").carriage, 1.0 * i);
  }
  for (int i = 7; i >= -3; --i) set(driver::kHalfSteps.at(static_cast<std::size_t>((i + 8) % 8)));
  EXPECT_EQ(rig.report("x").carriage, -3.0);
  EXPECT_EQ(rig.report("x").pulses_forward, 8);
  EXPECT_EQ(rig.report("x").pulses_backward, 11);
  set(0);
  EXPECT_FALSE(rig.report("x").energized);
  set(driver::kHalfSteps[5]);
  EXPECT_EQ(rig.report("x").carriage, -3.0) << "the pattern continues";
  EXPECT_EQ(total(), 0);
}

TEST_F(RigPhases, ReportsAJumpOfTwoHalfSteps) {
  set(0b0011);
  set(0b0110);
  EXPECT_EQ(count(Violation::kPatternJump), 1);
  EXPECT_EQ(total(), 1);
}

TEST_F(RigPhases, ReportsAWrongOrderOfCoils) {
  set(0b0011);
  set(0b1100);
  EXPECT_EQ(count(Violation::kPatternJump), 1);
  set(0b0101);
  EXPECT_EQ(count(Violation::kUndefinedPattern), 1);
  set(0b0111);
  EXPECT_EQ(count(Violation::kUndefinedPattern), 2);
  EXPECT_EQ(total(), 3);
}

TEST_F(RigPhases, ReportsAPatternThatDoesNotContinue) {
  set(0b0011);
  set(0);
  set(0b0010);
  EXPECT_EQ(count(Violation::kPatternJump), 1);
  EXPECT_EQ(rig.report("x").carriage, 1.0);
  lines.reset();
  EXPECT_EQ(total(), 1) << "released lines are off";
  request();
  set(0b0011);
  EXPECT_EQ(total(), 1) << "another program may begin anywhere";
  EXPECT_EQ(rig.report("x").carriage, 0.0);
}

TEST_F(RigPhases, ReportsACoilThatIsLeftOn) {
  lines.reset();
  lines = backend.request(
      {{"A", false, true}, {"B", false, true}, {"C", false, true}, {"D", false, true}}, {});
  set(0b0010);
  lines.reset();
  EXPECT_EQ(count(Violation::kCoilLeftOn), 1);
  EXPECT_EQ(total(), 1);
}

TEST_F(RigPhases, ReportsStepsThatAreTooCloseOrTooSoon) {
  set(0b0011);
  time += 1 * kMs;
  const gpio::LineWrite off{0, false};
  EXPECT_EQ(lines->write(&off, 1), 0);
  EXPECT_EQ(count(Violation::kStepAfterEnable), 1);
  time += 999;
  const gpio::LineWrite on{2, true};
  EXPECT_EQ(lines->write(&on, 1), 0);
  EXPECT_EQ(count(Violation::kShortStepHigh), 1);
}

class RigFullSteps : public RigPhases {
 protected:
  RigFullSteps() : RigPhases(1) {}
};

TEST_F(RigFullSteps, TakesTwoCoilsOfOneWriteAsAStepAndNoSingleCoil) {
  const auto write = [&](const std::vector<gpio::LineWrite>& writes) {
    time += 20 * kMs;
    ASSERT_EQ(lines->write(writes.data(), writes.size()), 0);
  };
  write({{0, true}, {1, true}});
  write({{0, false}, {2, true}});
  write({{3, true}, {1, false}});
  EXPECT_EQ(rig.report("x").carriage, 4.0);
  EXPECT_EQ(rig.report("x").pulses_forward, 2);
  EXPECT_EQ(rig.report("x").totalViolations(), 0);
  write({{3, false}});
  EXPECT_EQ(rig.report("x").violations.at(Violation::kCoilLeftOn), 1);
}

}  // namespace
}  // namespace stepdriver::sim
