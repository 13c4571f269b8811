#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/machine/machine.h"
#include "support/forgetful_rig.h"
#include "support/homing_kinds_bench.h"
#include "support/unthreaded_machine.h"

// Edges of an input that the kernel doesn't report: the level is read later, and nothing exact is
// known of the place. The flag is from 20 mm to 30 mm.

namespace stepdriver {
namespace {

using test::Bench;

class LostEdge : public testing::Test {
 protected:
  void build(std::int64_t debounce_ns) {
    config::AxisConfig config = test::flagAxis();
    config.homing->check_at_flag = config::FlagCheck::kFault;
    config.homing->flag_tolerance = 0.0002;
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
    specs[0].flags.push_back(test::flagOf("flag", 20.0, 30.0));
    machine::MachineOptions options;
    options.inputs = {test::inputNamed("flag")};
    options.inputs[0].debounce_ns = debounce_ns;
    machine_.reset();
    rig_ = std::make_unique<test::ForgetfulRig>(specs, nullptr, std::vector<sim::RigCoupling>{},
                                                std::nullopt, Bench::ioOf(options));
    clock_ = std::make_unique<pulse::VirtualClock>();
    backend_ = std::make_unique<gpio::SimulatedBackend>(*rig_, [this] { return clock_->now(); });
    machine_ = std::make_unique<test::UnthreadedMachine>(std::vector<config::AxisConfig>{config},
                                                         *backend_, *clock_, options);
    const axis::HomingResult homed = x().home();
    ASSERT_EQ(homed.end, axis::HomingEnd::kHomed) << homed.message;
  }
  axis::Axis& x() { return machine_->axis("x"); }
  void loseAll() {
    rig_->forget([](int) { return true; });
    rig_->readLate(5'000'000);
  }
  void moveTo(double place, double speed) { x().wait(x().moveTo(place, false, speed)); }

  std::unique_ptr<test::ForgetfulRig> rig_;
  std::unique_ptr<pulse::VirtualClock> clock_;
  std::unique_ptr<gpio::SimulatedBackend> backend_;
  std::unique_ptr<test::UnthreadedMachine> machine_;
};

TEST_F(LostEdge, OfAFlagIsNoLostStep) {
  for (const std::int64_t debounce_ns : {0, 2'000'000}) {
    SCOPED_TRACE(debounce_ns);
    build(debounce_ns);
    const double home = x().state().position;
    for (int period = 1; period <= 5; ++period) {
      rig_->forget([period](int edge) { return edge % period == 0; });
      rig_->readLate(5'000'000);
      for (int i = 0; i < 4; ++i) {
        moveTo(home + (i % 2 == 0 ? 0.03 : -0.01), 0.08);
        ASSERT_EQ(x().state().fault, "") << "each " << period << ", move " << i;
        ASSERT_TRUE(x().state().homed);
      }
    }
  }
}

TEST_F(LostEdge, OfALatchIsToldOf) {
  for (const std::int64_t debounce_ns : {0, 2'000'000}) {
    SCOPED_TRACE(debounce_ns);
    build(debounce_ns);
    const double home = x().state().position;
    moveTo(home - 0.01, 0.08);
    machine::LatchRequest request;
    request.input = "flag";
    request.axes = {"x"};
    for (const bool lost : {false, true}) {
      const machine::Latch latch = machine_->latch(request);
      if (lost) loseAll();
      moveTo(home + 0.005, 0.08);
      moveTo(home - 0.01, 0.08);
      const machine::LatchResult result = machine_->wait(latch);
      ASSERT_TRUE(result.latched);
      EXPECT_EQ(result.edge->was_read, lost);
      EXPECT_EQ(result.message, lost ? "the positions were latched when the input was read: the "
                                       "kernel has reported no edge"
                                     : "the positions were latched");
      // Read 5 ms later, at 80 mm/s.
      EXPECT_NEAR(result.edge->axes[0].position, lost ? home + 0.0004 : home, 2.0 * test::kStep);
    }
  }
}

TEST_F(LostEdge, OfAProbeIsToldOf) {
  build(2'000'000);
  const double home = x().state().position;
  machine::ProbeRequest request;
  request.input = "flag";
  request.names = {"x"};
  request.positions = {home + 0.02};
  request.velocity = 0.02;
  for (const bool lost : {false, true}) {
    moveTo(home - 0.01, 0.08);
    if (lost) loseAll();
    const machine::ProbeResult result = machine_->probe(request);
    EXPECT_EQ(result.end, machine::ProbeEnd::kContact) << result.message;
    const bool says_so =
        result.message.find("the kernel has reported no edge") != std::string::npos;
    EXPECT_EQ(says_so, lost) << result.message;
    EXPECT_NEAR(result.contact[0], lost ? home + 0.0001 : home, 2.0 * test::kStep);
  }
}

}  // namespace
}  // namespace stepdriver
