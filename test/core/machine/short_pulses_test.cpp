#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/machine/machine.h"
#include "support/homing_kinds_bench.h"
#include "support/unthreaded_machine.h"

// Pulses of an input that are over before anybody reads its level: only the kernel's time stamps
// tell of them. 1000 steps/mm; at 50 mm/s a pulse of a step is one of 20 us.

namespace stepdriver {
namespace {

using test::Bench;
using test::indexAxis;

constexpr double kFineStep = 1e-6;  // [m]

/// A rig on which nobody reads a line while it is active.
class UnseenRig : public sim::Rig {
 public:
  UnseenRig(const std::vector<sim::RigAxisSpec>& axes, const sim::RigIo& io,
            const std::string& unseen)
      : sim::Rig(axes, nullptr, {}, {}, io), unseen_(sim::Rig::lineIndex(unseen)) {}
  bool inputLevel(int line, std::int64_t time_ns) override {
    const bool level = sim::Rig::inputLevel(line, time_ns);
    return level && line != unseen_;
  }

 private:
  int unseen_;
};

/// The carriage of x passes the input index at 38 mm, which is active for a step, and a flag from
/// 20 to 30 mm.
class ShortPulse : public testing::Test {
 protected:
  void build(const std::string& flag) {
    config::AxisConfig config = indexAxis(flag);
    config.steps_per_unit = 1.0 / kFineStep;
    config.steps_per_round = 40'000.0;
    config.homing->latch_speed = 0.05;
    config.homing->offset = 0.038;
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
    specs[0].flags = {test::flagOf("index", 38.0, 38.0005), test::flagOf("flag", 20.0, 30.0)};
    machine::MachineOptions options;
    options.inputs = {test::inputNamed("index"), test::inputNamed("flag")};
    machine_.reset();
    rig_ = std::make_unique<UnseenRig>(specs, Bench::ioOf(options), "io.index");
    clock_ = std::make_unique<pulse::VirtualClock>();
    backend_ = std::make_unique<gpio::SimulatedBackend>(*rig_, [this] { return clock_->now(); });
    machine_ = std::make_unique<test::UnthreadedMachine>(std::vector<config::AxisConfig>{config},
                                                         *backend_, *clock_, options);
  }
  axis::Axis& x() { return machine_->axis("x"); }
  double carriage() { return rig_->report("x").carriage / 1e3; }

  std::unique_ptr<UnseenRig> rig_;
  std::unique_ptr<pulse::VirtualClock> clock_;
  std::unique_ptr<gpio::SimulatedBackend> backend_;
  std::unique_ptr<test::UnthreadedMachine> machine_;
};

TEST_F(ShortPulse, OfAnIndexIsTheTriggerPointAtItsExactPlace) {
  for (const std::string flag : {"", "flag"}) {
    SCOPED_TRACE(flag);
    build(flag);
    const axis::HomingResult result = x().home();
    ASSERT_EQ(result.end, axis::HomingEnd::kHomed) << result.message;
    // It begins in the middle between two counts; at 50,000 steps/s a nanosecond is 5e-5 steps.
    const double error = (x().state().position - carriage()) / kFineStep;
    EXPECT_NEAR(error, 0.5, 1e-4);
  }
}

TEST_F(ShortPulse, IsLatchedWithBothOfItsEdges) {
  build("");
  x().setPosition(0.0);
  machine::LatchRequest request;
  request.input = "index";
  request.edge = machine::LatchEdge::kEither;
  request.every = true;
  const machine::Latch latch = machine_->latch(request);
  x().wait(x().moveTo(0.05, false, 0.05));
  const std::vector<machine::LatchedEdge> edges = latch.record->take();
  ASSERT_EQ(edges.size(), 2U);
  for (const machine::LatchedEdge& edge : edges) {
    EXPECT_FALSE(edge.was_read);
    const double place = 38'000.0 + (edge.active ? -0.5 : 0.5);
    EXPECT_NEAR(edge.axes[0].position / kFineStep, place, 1e-4);
  }
  EXPECT_NEAR(static_cast<double>(edges[1].time - edges[0].time), 20'000.0, 1.0);
}

TEST_F(ShortPulse, EndsAProbing) {
  build("");
  x().setPosition(0.0);
  machine::ProbeRequest request;
  request.input = "index";
  request.names = {"x"};
  request.positions = {0.05};
  request.velocity = 0.05;
  const machine::ProbeResult result = machine_->probe(request);
  EXPECT_EQ(result.end, machine::ProbeEnd::kContact) << result.message;
  EXPECT_NEAR(result.contact.at(0) / kFineStep, 38'000.0 - 0.5, 1e-4);
  EXPECT_LT(result.positions.at(0), 0.0395) << "it came to rest";
}

}  // namespace
}  // namespace stepdriver
