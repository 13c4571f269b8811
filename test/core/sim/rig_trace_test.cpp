#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/sim/pin_trace.h"
#include "stepdriver_core/sim/rig.h"
#include "support/hand_rig.h"

namespace stepdriver::sim {
namespace {

using test::HandRig;
using test::plainAxis;

/// The pins of a trace with their first levels: `x.step=0 x.dir=1`.
std::string beginningOf(const MemoryTrace& trace) {
  std::string text;
  for (std::size_t i = 0; i < trace.pins().size(); ++i) {
    text += (i == 0 ? "" : " ") + trace.pins()[i].scope + '.' + trace.pins()[i].variable + '=' +
            (trace.levels()[i] ? '1' : '0');
  }
  return text;
}

RigAxisSpec axisWithBouncingSwitch() {
  RigAxisSpec spec = plainAxis("tb6600");
  spec.max_switch.emplace();
  spec.max_switch->line = "x.max";
  spec.max_switch->active_level = true;
  spec.max_switch->position = 0.2;
  spec.max_switch->bounces = 2;
  spec.max_switch->bounce_ns = 3'000;
  return spec;
}

TEST(RigTrace, BeginsWithTheLevelsOfTheRequests) {
  HandRig bench({plainAxis("a4988"), plainAxis("tb6600", "y")});
  bench.request("x.step", false).request("x.dir", true).request("x.enable", true);
  bench.request("x.ms1", true).request("x.sleep", true).request("x.reset", true);
  bench.request("y.dir", true);
  EXPECT_TRUE(bench.trace->pins().empty()) << "more requests may come at the same time";
  bench.rig.flushTrace();
  EXPECT_EQ(beginningOf(*bench.trace),
            "x.step=0 x.dir=1 x.enable=1 x.ms1=1 x.ms2=0 x.ms3=0 x.sleep=1 x.reset=1 "
            "y.step=0 y.dir=1 y.enable=1");
  EXPECT_TRUE(bench.trace->edges().empty());
}

TEST(RigTrace, ShowsALaterRequestAsAnEdge) {
  HandRig bench(plainAxis("tb6600"));
  bench.request("x.step", false).wait(500).request("x.dir", true).request("x.enable", true);
  EXPECT_EQ(bench.trace->times("x", "dir", true), (std::vector<std::int64_t>{bench.now}));
  EXPECT_TRUE(bench.trace->times("x", "enable", true).empty()) << "it was high before";
}

TEST(RigTrace, HasOnlyWiredPinsAndLevelsOfTheLine) {
  RigAxisSpec spec = plainAxis("tb6600");
  spec.enable = Wire{};
  spec.step.inverted = true;
  HandRig bench(spec);
  bench.request("x.step", true).wait(10).set("x.step", false);
  EXPECT_EQ(beginningOf(*bench.trace), "x.step=1 x.dir=0");
  EXPECT_EQ(bench.trace->times("x", "step", false), (std::vector<std::int64_t>{bench.now}));
  EXPECT_EQ(bench.report().pulses_backward, 1);
}

TEST(RigTrace, SaysWhichLevelsAreAPulseAndForward) {
  for (const bool step_active : {true, false}) {
    RigAxisSpec spec = plainAxis("tb6600");
    spec.chip.step_active = step_active;
    spec.dir.inverted = true;
    HandRig bench(spec);
    bench.request("x.step", !step_active);
    bench.rig.flushTrace();
    EXPECT_EQ(bench.trace->pins().at(0).active, step_active);
    EXPECT_EQ(bench.trace->pins().at(1).active, false) << "low is forward, because it is inverted";
    EXPECT_FALSE(bench.trace->pins().at(2).active.has_value());
  }
}

TEST(RigTrace, BringsBouncesInTheOrderOfTime) {
  HandRig bench(axisWithBouncingSwitch());
  bench.ready();
  const std::int64_t start = bench.now;
  bench.set("x.step", true).wait(5'000).set("x.step", false).wait(5'000).set("x.step", true);
  std::vector<std::string> order;
  for (const MemoryTrace::Edge& edge : bench.trace->edges()) {
    order.push_back(bench.trace->pins()[static_cast<std::size_t>(edge.pin)].variable +
                    (edge.level ? " 1 @" : " 0 @") + std::to_string(edge.time_ns - start));
  }
  EXPECT_EQ(order, (std::vector<std::string>{"step 1 @0", "endstop_max 1 @0", "endstop_max 0 @3000",
                                             "step 0 @5000", "endstop_max 1 @6000",
                                             "endstop_max 0 @9000", "step 1 @10000"}));
}

TEST(RigTrace, EndsWithSettledSwitches) {
  auto bench = std::make_unique<HandRig>(axisWithBouncingSwitch());
  bench->ready().set("x.step", true);
  const auto trace = bench->trace;
  const std::int64_t hit = bench->now;
  bench.reset();
  EXPECT_EQ(trace->times("x", "endstop_max", true),
            (std::vector<std::int64_t>{hit, hit + 6'000, hit + 12'000}));
}

TEST(RigTrace, ShowsASwitchThatGetsStuckAtTheLatestTimeKnown) {
  HandRig bench(axisWithBouncingSwitch());
  bench.ready().set("x.dir", false).wait(1'000);
  RigFaults faults;
  faults.max_stuck = true;
  bench.rig.setFaults("x", faults);
  EXPECT_EQ(bench.trace->times("x", "endstop_max", true),
            (std::vector<std::int64_t>{bench.now - 1'000}));
}

TEST(RigTrace, NeverFallsBackInTime) {
  HandRig bench(axisWithBouncingSwitch());
  bench.ready().set("x.dir", false);
  bench.rig.onEdge(bench.line("x.dir"), true, bench.now - 700);
  EXPECT_EQ(bench.trace->times("x", "dir", true), (std::vector<std::int64_t>{bench.now}));
}

}  // namespace
}  // namespace stepdriver::sim
