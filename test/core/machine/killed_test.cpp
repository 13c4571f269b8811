#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/contents_of.h"
#include "support/homing_bench.h"
#include "support/temporary_folder.h"

// The state file of a machine that is killed at any instant, and the next start with that file.

namespace stepdriver {
namespace {

using axis::AxisState;
using axis::HomingPhase;
using test::Bench;
using test::homingAxis;

constexpr double kTick = 0.005;  // [s]

class Killed : public testing::Test {
 protected:
  void SetUp() override {
    for (config::AxisConfig& config : axes_) {
      config.holds_position_unpowered = true;
      config.backlash = 40 / config.steps_per_unit;
    }
    start();
    for (const std::string& name : names()) {
      axis(name).setPosition(0.0);
      ASSERT_EQ(bench_->move(0.008, name).end, axis::MoveEnd::kReached);
    }
    bench_->machine->advance(kTick);
    noteRests();
  }

  std::string file() const { return folder_.path() + "/state"; }
  axis::Axis& axis(const std::string& name) { return bench_->axis(name); }
  AxisState state(const std::string& name = "x") { return axis(name).state(); }
  static std::vector<std::string> names() { return {"x", "y"}; }

  void start() {
    bench_.reset();
    machine::MachineOptions options;
    options.state_file = file();
    bench_ = std::make_unique<Bench>(axes_, Bench::rigAxes(axes_), false, 0.0, options);
  }

  /// Keeps the positions of the axes that are at rest.
  void noteRests() {
    for (std::size_t i = 0; i < rests_.size(); ++i) {
      const AxisState now = state(names()[i]);
      if (!now.moving) rests_[i] = now.position;
    }
  }

  /// Compares the state after a kill at this instant with the positions at which the axes were last
  /// at rest. The machine isn't killed: another one reads a copy of its file.
  void checkAKillNow() {
    const Left left = leftNow();
    for (std::size_t i = 0; i < left.axes.size(); ++i) {
      const AxisState& after = left.axes[i];
      SCOPED_TRACE(names()[i] + ", killed at " + std::to_string(state(names()[i]).position) + " m");
      EXPECT_FALSE(after.position_valid);
      EXPECT_FALSE(after.homed);
      EXPECT_FALSE(after.moving);
      EXPECT_EQ(left.pulses, 0);
      EXPECT_NEAR(after.position, rests_[i], 1e-9);
      const bool says_moving = after.position_note.find("was moving, from") != std::string::npos;
      EXPECT_EQ(says_moving, state(names()[i]).moving) << after.position_note;
      EXPECT_NE(after.position_note.find("wasn't shut down"), std::string::npos)
          << after.position_note;
    }
    ++kills_;
  }

  struct Left {
    std::vector<AxisState> axes;
    std::int64_t pulses = 0;
  };
  Left leftNow() const {
    const std::string copy = folder_.path() + "/copy";
    std::ofstream(copy) << test::contentsOf(file());
    machine::MachineOptions options;
    options.state_file = copy;
    Left left;
    {
      Bench next(axes_, Bench::rigAxes(axes_), false, 0.0, options);
      for (const std::string& name : names()) {
        left.axes.push_back(next.axis(name).state());
        left.pulses += std::abs(next.pulses(name));
      }
    }
    for (const char* end : {"", ".lock"}) std::remove((copy + end).c_str());
    return left;
  }

  /// Kills the machine at each tick until all axes have been at rest for a while.
  void killUntilRest() {
    for (int at_rest = 0; at_rest < 3;) {
      bench_->machine->advance(kTick);
      noteRests();
      checkAKillNow();
      ASSERT_FALSE(HasFailure());
      const bool moves = state("x").moving || state("y").moving;
      at_rest = moves ? 0 : at_rest + 1;
      ASSERT_LT(kills_, 1000);
    }
  }

  std::vector<config::AxisConfig> axes_{homingAxis("x"), homingAxis("y")};
  std::vector<double> rests_{0.0, 0.0};
  const test::TemporaryFolder folder_;
  std::unique_ptr<Bench> bench_;
  int kills_ = 0;
};

// Backlash, acceleration, full speed, deceleration and rest: 0.5 s.
TEST_F(Killed, AtAnyInstantOfAMoveSaysFromWhereItMoved) {
  axis("x").moveTo(-0.030);
  killUntilRest();
  EXPECT_GT(kills_, 80);
  EXPECT_DOUBLE_EQ(state().position, -0.030);
}

TEST_F(Killed, AtAnyInstantOfAMoveThatReplacesAnotherSaysFromWhereTheFirstBegan) {
  axis("x").moveTo(0.040);
  bench_->machine->advance(0.2);
  axis("x").moveTo(-0.010);
  killUntilRest();
  EXPECT_GT(kills_, 60);
}

TEST_F(Killed, AtAnyInstantOfAJogAndItsStopSaysFromWhereItMoved) {
  axis("x").jog(0.05);
  for (int i = 0; i < 40; ++i) {
    bench_->machine->advance(kTick);
    checkAKillNow();
  }
  axis("x").stop();
  killUntilRest();
}

TEST_F(Killed, AtAnyInstantOfALineSaysFromWhereEachAxisMoved) {
  bench_->machine->moveLine({{"x", "y"}, {0.030, -0.020}});
  killUntilRest();
  EXPECT_GT(kills_, 60);
  EXPECT_DOUBLE_EQ(state("y").position, -0.020);
}

TEST_F(Killed, AtAnyInstantOfATrajectorySaysFromWhereEachAxisMoved) {
  motion::TrajectoryRequest request;
  request.names = {"x", "y"};
  for (const auto& [time, place] :
       std::vector<std::pair<double, double>>{{0.4, 0.020}, {0.8, 0.004}}) {
    motion::TrajectoryPoint point;
    point.time = time;
    point.positions = {place, place};
    point.velocities = {0.0, 0.0};
    request.points.push_back(point);
  }
  bench_->machine->followTrajectory(request);
  killUntilRest();
  EXPECT_GT(kills_, 150);
}

TEST_F(Killed, InAnyPhaseOfAHomingLeavesAnAxisThatIsNotHomed) {
  std::set<HomingPhase> killed_in;
  std::int64_t pulses = 0;
  const axis::HomingResult result = axis("x").home([&] {
    bench_->machine->advance(0.001);
    noteRests();
    // Each 100 steps, and once in each phase.
    const bool is_new = killed_in.insert(state().homing).second;
    if (!is_new && std::abs(bench_->pulses() - pulses) < 100) return false;
    pulses = bench_->pulses();
    checkAKillNow();
    return HasFailure();
  });
  EXPECT_EQ(result.end, axis::HomingEnd::kHomed) << result.message;
  EXPECT_GT(kills_, 80);
  for (const HomingPhase phase : {HomingPhase::kSeeking, HomingPhase::kBackingOff,
                                  HomingPhase::kLatching, HomingPhase::kPullingOff}) {
    EXPECT_EQ(killed_in.count(phase), 1U) << static_cast<int>(phase);
  }
  // Killed when it is homed and at rest, it isn't homed either.
  bench_->machine->advance(kTick);
  noteRests();
  EXPECT_TRUE(state().homed);
  checkAKillNow();
}

}  // namespace
}  // namespace stepdriver
