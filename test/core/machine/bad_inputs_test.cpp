#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/homing_bench.h"
#include "support/refusal.h"

// Inputs that lie: a switch that chatters, switches whose wires are swapped, and a chip that is at
// fault before the machine starts.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::homingAxis;
using test::linearAxis;
using test::violationsOf;

/// Opens and closes a switch as fast as it can, in a thread of its own.
class Chatter {
 public:
  Chatter(sim::Rig& rig, std::optional<bool> sim::RigFaults::*which)
      : thread_([this, &rig, which] {
          sim::RigFaults faults;
          for (bool pressed = true; !ended_; pressed = !pressed) {
            faults.*which = pressed;
            rig.setFaults("x", faults);
            if (pressed) ++contacts_;
            std::this_thread::yield();
          }
          rig.setFaults("x", {});
        }) {}
  ~Chatter() {
    ended_ = true;
    thread_.join();
  }
  Chatter(const Chatter&) = delete;
  Chatter& operator=(const Chatter&) = delete;

  void awaitContacts(int count) const {
    while (contacts_ < count) std::this_thread::yield();
  }

 private:
  std::atomic<bool> ended_{false};
  std::atomic<int> contacts_{0};
  std::thread thread_;
};

class ChatteringSwitch : public testing::Test {
 protected:
  void expectPositionOfThePulses() {
    EXPECT_DOUBLE_EQ(bench.axis().state().position, static_cast<double>(bench.pulses()) / 80'000.0);
  }
  Bench bench{{linearAxis("x")}, true, 1.0};
};

TEST_F(ChatteringSwitch, BehindTheAxisEndsNoMove) {
  const Chatter chatter(bench.rig, &sim::RigFaults::min_stuck);
  chatter.awaitContacts(10);
  EXPECT_EQ(bench.move(0.03).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 2400);
  expectPositionOfThePulses();
  EXPECT_EQ(bench.axis().state().fault, "");
}

TEST_F(ChatteringSwitch, AheadOfTheAxisEndsItsMoveAndLetsItMoveAway) {
  EXPECT_EQ(bench.move(0.01).end, MoveEnd::kReached);
  const axis::Move move = bench.axis().moveTo(0.08);
  while (bench.axis().state().position < 0.02) std::this_thread::yield();
  {
    const Chatter chatter(bench.rig, &sim::RigFaults::max_stuck);
    const axis::MoveResult result = bench.axis().wait(move);
    EXPECT_EQ(result.end, MoveEnd::kEndstopMax) << result.message;
    EXPECT_LT(bench.pulses(), 6400);
    expectPositionOfThePulses();
    chatter.awaitContacts(100);
    EXPECT_EQ(bench.move(0.005).end, MoveEnd::kReached);
  }
  EXPECT_EQ(bench.pulses(), 400);
  expectPositionOfThePulses();
}

class SwappedSwitches : public test::HomingTest {};

// The axis presses the switch that it takes for the other one.
TEST_F(SwappedSwitches, FailAHomingWithinItsTravel) {
  config::AxisConfig config = homingAxis();
  config.homing->max_travel = 0.11;
  build(config,
        [](sim::RigAxisSpec& spec) { std::swap(spec.min_switch->line, spec.max_switch->line); });
  const axis::HomingResult result = x().home();
  EXPECT_EQ(result.end, axis::HomingEnd::kFailed);
  EXPECT_NE(result.message.find("min switch didn't close within max_travel"), std::string::npos)
      << result.message;
  EXPECT_EQ(bench->pulses(), -8800);
  EXPECT_FALSE(x().state().homed);
  EXPECT_FALSE(x().state().position_valid);
  EXPECT_FALSE(x().state().moving);
}

TEST(ChipFaultAtTheStart, LetsTheMachineStartAtFaultAndSendsNoPulse) {
  config::AxisConfig config = linearAxis("x", "drv8825");
  config.fault = config::FaultPin{"x.fault", Bias::kPullUp};
  std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
  specs[0].fault_line.clear();  // its level doesn't depend on the chip
  sim::Rig rig(specs);
  pulse::VirtualClock clock(0.0);
  rig.setInput("x.fault", false, clock.now());
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  test::UnthreadedMachine machine({config}, backend, clock);
  axis::Axis& x = machine.axis("x");
  machine.advance(0.1);  // the chip wakes
  machine.advance(0.1);
  EXPECT_NE(x.state().fault.find("nFAULT"), std::string::npos) << x.state().fault;
  EXPECT_FALSE(x.state().position_valid);
  EXPECT_REFUSED(x.moveTo(0.01), "nFAULT");
  EXPECT_REFUSED(machine.recover(), "still reports");
  EXPECT_EQ(rig.report("x").pulses_forward, 0);
  rig.setInput("x.fault", true, clock.now());
  machine.recover();
  EXPECT_EQ(x.state().fault, "");
  EXPECT_EQ(x.wait(x.moveTo(0.01)).end, MoveEnd::kReached);
  EXPECT_EQ(rig.report("x").pulses_forward, 800);
  EXPECT_EQ(violationsOf(rig.report("x")), "");
}

}  // namespace
}  // namespace stepdriver
