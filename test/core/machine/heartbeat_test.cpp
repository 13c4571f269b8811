#include <gtest/gtest.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/machine/recording.h"
#include "support/bench.h"

namespace stepdriver {
namespace {

using machine::Recording;
using test::Bench;
using test::linearAxis;

constexpr const char* kHeartbeatLine = "heartbeat";
constexpr std::int64_t kInterval = 5'000'000;  // ns, at the default rate

class MachineHeartbeat : public testing::Test {
 protected:
  void SetUp() override {
    const std::vector<config::AxisConfig> axes{linearAxis("x"), linearAxis("y")};
    machine::MachineOptions options;
    options.record_seconds = 60.0;
    options.heartbeat = machine::HeartbeatConfig{kHeartbeatLine};
    bench = std::make_unique<Bench>(axes, Bench::rigAxes(axes), false, 0.0, options);
  }

  /// Times of its edges, as recorded.
  std::vector<std::int64_t> beats() const {
    const Recording recording = bench->machine->recording();
    int output = -1;
    for (const Recording::Pin& pin : recording.pins) {
      if (pin.axis == "machine" && pin.name == "heartbeat") output = pin.output;
    }
    std::vector<std::int64_t> times;
    for (const Recording::Edge& edge : recording.edges) {
      if (edge.output == output) times.push_back(edge.time);
    }
    return times;
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(MachineHeartbeat, ComesAtItsRateAtRestInMotionAndInAnEmergencyStop) {
  bench->machine->advance(1.0);
  bench->move(0.05);
  bench->machine->emergencyStop();
  bench->machine->advance(1.0);
  const std::vector<std::int64_t> times = beats();
  ASSERT_GT(times.size(), 2U * 200U);
  for (std::size_t i = 1; i < times.size(); ++i) {
    EXPECT_EQ(times[i] - times[i - 1], kInterval) << "after " << times[i - 1] << " ns";
  }
  EXPECT_LT(bench->clock.now() - times.back(), kInterval);
}

TEST_F(MachineHeartbeat, ThatCantBeWrittenIsAFaultOfEveryAxisAndNamesItsLine) {
  axis::Axis& x = bench->axis("x");
  const axis::Move move = x.moveTo(0.05);
  bench->machine->advance(0.1);
  bench->rig.failWrites(kHeartbeatLine, 0, EIO);
  bench->machine->advance(1.0);
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kFault);
  for (const auto& axis : bench->machine->axes()) {
    EXPECT_NE(axis->state().fault.find(kHeartbeatLine), std::string::npos) << axis->state().fault;
    EXPECT_FALSE(axis->state().position_valid);
  }
  bench->rig.clearWriteFault(kHeartbeatLine);
  bench->machine->advance(0.1);
  const std::size_t before = beats().size();
  bench->machine->recover();
  bench->machine->advance(0.1);
  EXPECT_EQ(x.state().fault, "");
  EXPECT_GE(beats().size(), before + 20);
  bench->move(0.01, "y");
}

}  // namespace
}  // namespace stepdriver
