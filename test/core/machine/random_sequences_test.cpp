#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/differences.h"
#include "support/random_motion.h"

// A hundred thousand sequences of random commands on two axes, compared with what must always be
// true: the position is the count of the edges, the differentiated trace keeps the limits, the rig
// sees no violation, and the same seed gives the same trace.

namespace stepdriver {
namespace {

using motion::Random;
using test::Bench;
using test::Crossing;
using test::linearAxis;
using test::violationsOf;

constexpr int kShards = 10;
constexpr int kBatches = 50;     // batches of each shard, each on a machine of its own
constexpr int kSequences = 200;  // sequences in each batch

constexpr double kSpeed = 0.1;         // m/s
constexpr double kAcceleration = 2.0;  // m/s^2
constexpr double kDeceleration = 1.5;  // m/s^2
constexpr double kStopping = 3.0;      // m/s^2
constexpr double kJerk = 60.0;         // m/s^3
constexpr double kReach = 0.02;        // m
constexpr int kStopTurns = 30;         // turns of 10 ms, and no stop from kSpeed takes longer
constexpr double kStepsPerUnit = 80'000.0;
constexpr int kMicrosteps = 16;

config::AxisConfig axisOf(const std::string& name, bool smooth) {
  config::AxisConfig config = linearAxis(name);
  config.max_speed = kSpeed;
  config.acceleration = kAcceleration;
  config.deceleration = kDeceleration;
  config.stop_deceleration = kStopping;
  config.jerk = smooth ? kJerk : 0.0;
  config.min_position = -kReach;
  config.max_position = kReach;
  config.align_on_microstep_change = true;
  return config;
}

struct Refusals {
  int held = 0;
  int beyond_limits = 0;
};

class Batch {
 public:
  Batch(unsigned seed, bool smooth)
      : random_(seed), smooth_(smooth), bench_({axisOf("x", smooth), axisOf("y", smooth)}) {}

  void run(int sequences) {
    for (int i = 0; i < sequences && !testing::Test::HasFatalFailure(); ++i) {
      SCOPED_TRACE(testing::Message() << "sequence " << i);
      sequence();
    }
  }

  const std::vector<sim::MemoryTrace::Edge>& trace() const { return bench_.trace->edges(); }
  int lines() const { return lines_; }
  int endstops() const { return endstops_; }
  const Refusals& refused() const { return refused_; }
  std::size_t rows() const { return rows_; }

 private:
  struct Watched {
    std::string name;
    bool forward = false;     // level of the DIR line when a sequence begins
    double position = 0.0;    // from the pulses that the rig has counted
    std::int64_t pulses = 0;  // number of pulses
    int microsteps = kMicrosteps;
  };

  void sequence() {
    if (random_.chance(0.2)) changeMicrosteps();
    for (Watched& axis : axes_) axis.forward = lastDirection(axis);
    first_edge_ = trace().size();
    slipped_ = bench_.machine->figures().slipped;
    const auto commands = random_.whole(1, 5);
    for (std::int64_t i = 0; i < commands; ++i) {
      command();
      bench_.machine->advance(random_.chance(0.2) ? 0.0 : random_.within(0.0, 0.08));
      checkPositions();
    }
    const bool pressed = random_.chance(0.1);
    if (pressed) press();
    bench_.machine->resume();
    bench_.machine->setSpeedOverride(1.0);
    if (random_.chance(0.5)) bench_.machine->stop();
    rest();
    bench_.machine->stop();  // a jog that would continue for ever, and a held motion
    rest();
    checkPositions();
    // A switch ends a motion in one step.
    if (!pressed) {
      for (const Watched& axis : axes_) checkLimits(axis);
    }
  }

  void command() {
    test::UnthreadedMachine& machine = *bench_.machine;
    axis::Axis& axis = bench_.axis(random_.chance(0.5) ? "x" : "y");
    const double velocity = random_.chance(0.5) ? 0.0 : random_.within(0.002, kSpeed);
    try {
      switch (random_.whole(0, 9)) {
        case 0:
        case 1:
        case 2:
          axis.moveTo(place(), false, velocity);
          break;
        case 3:
          axis.moveTo(random_.within(-0.002, 0.002), true, velocity);
          break;
        case 4:
          axis.jog(random_.within(-kSpeed, kSpeed));
          break;
        case 5:
          axis.stop();
          break;
        case 6:
          machine.setSpeedOverride(random_.within(0.05, 2.0));
          break;
        case 7:
          random_.chance(0.5) ? machine.hold() : machine.resume();
          break;
        default:
          machine.moveLine({{"x", "y"}, {place(), place()}, false, velocity});
          ++lines_;
      }
    } catch (const Refused& refusal) {
      count(refusal);
    }
  }

  // These commands are never refused for any other reason.
  void count(const Refused& refusal) {
    const std::string text = refusal.what();
    if (text.find(": the machine is on hold; resume or stop it first") != std::string::npos) {
      ++refused_.held;
    } else if (text.find("soft limit") != std::string::npos) {
      ++refused_.beyond_limits;
    } else {
      ADD_FAILURE() << "refused: " << text;
    }
  }

  double place() { return random_.within(-0.2 * kReach, 0.2 * kReach); }

  void changeMicrosteps() {
    Watched& axis = axes_[static_cast<std::size_t>(random_.whole(0, 1))];
    const int microsteps = 1 << random_.whole(2, 4);
    // The nearest position that both modes have may be beyond a soft limit.
    try {
      bench_.axis(axis.name).setMicrosteps(microsteps);
    } catch (const Refused& refusal) {
      count(refusal);
    }
    checkPositions();
    axis.microsteps = bench_.axis(axis.name).state().microsteps;
  }

  // Somebody presses a switch in mid-motion.
  void press() {
    const std::string name = random_.chance(0.5) ? "x" : "y";
    sim::RigFaults faults;
    (random_.chance(0.5) ? faults.min_stuck : faults.max_stuck) = true;
    bench_.rig.setFaults(name, faults);
    const bool moving = bench_.axis(name).state().moving;
    bench_.machine->advance(0.05);
    endstops_ += moving && !bench_.axis(name).state().moving ? 1 : 0;
    checkPositions();
    bench_.machine->stop();
    rest();
    bench_.rig.setFaults(name, {});
  }

  void rest() {
    for (const Watched& axis : axes_) {
      const axis::AxisState state = bench_.axis(axis.name).state();
      if (!state.moving) continue;
      for (int i = 0; i < 200 && bench_.axis(axis.name).state().moving; ++i) {
        bench_.machine->advance(0.01);
      }
      if (bench_.axis(axis.name).state().moving) bench_.axis(axis.name).stop();
      for (int i = 0; i < kStopTurns && bench_.axis(axis.name).state().moving; ++i) {
        bench_.machine->advance(0.01);
      }
      ASSERT_FALSE(bench_.axis(axis.name).state().moving)
          << axis.name << " moves " << kStopTurns << " turns of 10 ms after its stop, at "
          << bench_.axis(axis.name).state().velocity << " m/s";
    }
  }

  void checkPositions() {
    for (Watched& axis : axes_) {
      const axis::AxisState state = bench_.axis(axis.name).state();
      const sim::RigAxisReport seen = bench_.report(axis.name);
      ASSERT_EQ(violationsOf(seen), "") << axis.name;
      const std::int64_t pulses = bench_.pulses(axis.name) - axis.pulses;
      axis.pulses += pulses;
      axis.position += static_cast<double>(pulses) / scaleOf(axis);
      ASSERT_NEAR(state.position, axis.position, 1e-9) << axis.name;
      ASSERT_LE(std::abs(state.position), kReach + 0.5 / scaleOf(axis)) << axis.name;
    }
  }

  double scaleOf(const Watched& axis) const {
    return kStepsPerUnit * axis.microsteps / kMicrosteps;
  }

  // A DIR change close to a step may slide the timeline; then the times aren't those of the curve.
  void checkLimits(const Watched& axis) {
    if (bench_.machine->figures().slipped != slipped_) return;
    const std::vector<Crossing> crossings = crossingsOf(axis);
    rows_ += crossings.size();
    const double scale = scaleOf(axis);
    // Rounding adds at most a hundredth of the limit.
    const double jerk_apart = std::cbrt(8.0 * kSpeed * 1e-9 / (0.01 * kJerk));
    const double apart = std::sqrt(4.0 * kSpeed * 1e-9 / (0.01 * kStopping));
    const test::Differences near = test::differencesOf(crossings, apart);
    ASSERT_LE(near.speed, kSpeed * scale * 1.0001) << axis.name;
    ASSERT_LE(near.acceleration, kStopping * scale * 1.011) << axis.name;
    if (!smooth_) return;
    ASSERT_LE(test::differencesOf(crossings, jerk_apart).jerk, kJerk * scale * 1.011) << axis.name;
  }

  bool lastDirection(const Watched& axis) const {
    const int dir = bench_.trace->pin(axis.name, "dir");
    bool forward = axis.forward;
    for (std::size_t i = first_edge_; i < trace().size(); ++i) {
      if (trace()[i].pin == dir) forward = trace()[i].level;
    }
    return forward;
  }

  std::vector<Crossing> crossingsOf(const Watched& axis) {
    const int step = bench_.trace->pin(axis.name, "step");
    const int dir = bench_.trace->pin(axis.name, "dir");
    std::vector<Crossing> crossings;
    bool forward = axis.forward;
    double position = 0.0;
    for (std::size_t i = first_edge_; i < trace().size(); ++i) {
      const auto& edge = trace()[i];
      if (edge.pin == dir) forward = edge.level;
      if (edge.pin != step || !edge.level) continue;
      const double way = forward ? 0.5 : -0.5;
      crossings.push_back({edge.time_ns, position + way});
      position += 2.0 * way;
    }
    return crossings;
  }

  Random random_;
  const bool smooth_;
  Bench bench_;
  std::vector<Watched> axes_{{"x"}, {"y"}};
  std::size_t first_edge_ = 0;  // the first edge of the sequence
  double slipped_ = 0.0;        // s, when it began
  int lines_ = 0;
  int endstops_ = 0;
  Refusals refused_;
  std::size_t rows_ = 0;
};

class RandomSequences : public testing::TestWithParam<int> {};

TEST_P(RandomSequences, KeepEveryPromise) {
  int lines = 0;
  int endstops = 0;
  Refusals refused;
  std::size_t rows = 0;
  for (int batch = 0; batch < kBatches && !HasFatalFailure(); ++batch) {
    const auto seed = static_cast<unsigned>(GetParam() * kBatches + batch);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const bool smooth = batch % 2 == 0;
    const auto run = std::make_unique<Batch>(seed, smooth);
    run->run(kSequences);
    lines += run->lines();
    endstops += run->endstops();
    refused.held += run->refused().held;
    refused.beyond_limits += run->refused().beyond_limits;
    rows += run->rows();
    if (batch != 0 || HasFatalFailure()) continue;
    const auto again = std::make_unique<Batch>(seed, smooth);
    again->run(kSequences);
    ASSERT_EQ(run->trace().size(), again->trace().size());
    for (std::size_t i = 0; i < run->trace().size(); ++i) {
      ASSERT_EQ(run->trace()[i].time_ns, again->trace()[i].time_ns) << i;
      ASSERT_EQ(run->trace()[i].pin, again->trace()[i].pin) << i;
      ASSERT_EQ(run->trace()[i].level, again->trace()[i].level) << i;
    }
  }
  EXPECT_GT(lines, kBatches * kSequences / 10);
  EXPECT_GT(endstops, kBatches * kSequences / 1000);
  EXPECT_GT(refused.held, kBatches * kSequences / 100);
  EXPECT_GT(refused.beyond_limits, kBatches * kSequences / 200);
  EXPECT_GT(rows, 100U * kBatches * kSequences);
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomSequences, testing::Range(0, kShards));

}  // namespace
}  // namespace stepdriver
