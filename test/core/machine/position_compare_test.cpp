#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/corexy_bench.h"
#include "support/path_bench.h"
#include "support/refusal.h"
#include "support/runs.h"
#include "support/traced_place.h"

// Outputs that the position of an axis switches. The judge knows only the rig's trace: the joint
// follows the steps of the motor with the play of the backlash, and each arrival at a place is to
// have its edge at the nanosecond of that step.

namespace stepdriver {
namespace {

using config::PositionCompare;
using machine::OutputState;
using test::Bench;
using test::kMicrostep;
using test::kMillisecond;
using test::kNan;
using test::kSecond;
using Direction = PositionCompare::Direction;

/// When the joint of an axis has come to which count, by the trace.
struct Arrival {
  std::int64_t time_ns = 0;
  std::int64_t count = 0;
  int direction = 0;
};

struct Edge {
  std::int64_t time_ns = 0;
  bool on = false;
};

class PositionCompareTest : public test::PathBench {
 protected:
  void SetUp() override {
    options.outputs.resize(3);
    options.outputs[0].name = "camera";
    options.outputs[0].line = "camera.line";
    options.outputs[1].name = "valve";
    options.outputs[1].line = "valve.line";
    options.outputs[1].active_level = false;
    options.outputs[2].name = "bell";
    options.outputs[2].line = "bell.line";
    axes = {plotterAxis("x"), plotterAxis("y")};
    begin();
  }

  void begin() {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
    for (sim::RigAxisSpec& spec : specs) spec.max_switch->position = 100'000.0;
    bench = std::make_unique<Bench>(axes, specs, false, 0.0, options);
    for (const config::AxisConfig& axis : axes) bench->axis(axis.name).setPosition(0.0);
  }

  static PositionCompare every(double distance, double from, double to, double pulse = 1e-3) {
    PositionCompare compare;
    compare.axis = "x";
    compare.every = PositionCompare::Every{distance, from, to};
    compare.pulse_ns = std::llround(pulse * 1e9);
    return compare;
  }
  static PositionCompare at(std::vector<double> places, double pulse = 1e-3) {
    PositionCompare compare;
    compare.axis = "x";
    compare.places = std::move(places);
    compare.pulse_ns = std::llround(pulse * 1e9);
    return compare;
  }
  static PositionCompare cam(double from, double to) {
    PositionCompare compare;
    compare.axis = "x";
    compare.cams = {{from, to}};
    return compare;
  }

  void move(double target, const std::string& axis = "x") {
    const axis::MoveResult result = bench->axis(axis).wait(bench->axis(axis).moveTo(target));
    EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
  }

  std::vector<Edge> edges(std::size_t output = 0) const {
    const config::OutputConfig& config = options.outputs[output];
    std::vector<Edge> all;
    for (const bool on : {true, false}) {
      for (const std::int64_t time :
           bench->trace->times("outputs", config.name, on == config.active_level)) {
        all.push_back({time, on});
      }
    }
    std::sort(all.begin(), all.end(), [](const Edge& a, const Edge& b) {
      return a.time_ns != b.time_ns ? a.time_ns < b.time_ns : !a.on && b.on;
    });
    return all;
  }
  std::vector<std::int64_t> switchedOn(std::size_t output = 0) const {
    std::vector<std::int64_t> times;
    for (const Edge& edge : edges(output)) {
      if (edge.on) times.push_back(edge.time_ns);
    }
    return times;
  }
  OutputState shown(std::size_t output = 0) { return machine().ioStates().outputs.at(output); }

  /// @param play [microsteps] all of the backlash
  std::vector<Arrival> arrivals(std::int64_t play = 0, const std::string& name = "x") const {
    const sim::MemoryTrace& trace = *bench->trace;
    const int step = trace.pin(name, "step");
    const int dir = trace.pin(name, "dir");
    bool forward = trace.levels()[static_cast<std::size_t>(dir)];
    std::vector<Arrival> found;
    std::int64_t count = 0;
    std::int64_t slack = 0;
    for (const sim::MemoryTrace::Edge& edge : trace.edges()) {
      if (edge.pin == dir) forward = edge.level;
      if (edge.pin != step || !edge.level) continue;
      if (forward && slack < play) {
        ++slack;
      } else if (!forward && slack > 0) {
        --slack;
      } else {
        const int direction = forward ? 1 : -1;
        found.push_back({edge.time_ns, count += direction, direction});
      }
    }
    return found;
  }
  /// The times of the arrivals at these counts.
  static std::vector<std::int64_t> timesAt(const std::vector<Arrival>& arrivals,
                                           const std::vector<std::int64_t>& counts,
                                           int direction = 0) {
    std::vector<std::int64_t> times;
    for (const Arrival& arrival : arrivals) {
      if (direction != 0 && arrival.direction != direction) continue;
      if (std::find(counts.begin(), counts.end(), arrival.count) == counts.end()) continue;
      times.push_back(arrival.time_ns);
    }
    return times;
  }
  static std::vector<std::int64_t> multiples(std::int64_t of, std::int64_t first,
                                             std::int64_t last) {
    std::vector<std::int64_t> all;
    for (std::int64_t count = first; count <= last; count += of) all.push_back(count);
    return all;
  }
  static void expectTimes(const std::vector<std::int64_t>& times,
                          const std::vector<std::int64_t>& wanted) {
    ASSERT_EQ(times.size(), wanted.size());
    for (std::size_t i = 0; i < times.size(); ++i) {
      ASSERT_LE(std::abs(times[i] - wanted[i]), 1) << i << " at " << times[i];
    }
  }

  machine::MachineOptions options;
  std::vector<config::AxisConfig> axes;
};

// The camera of the examples: every 2 mm at 100 mm/s.
TEST_F(PositionCompareTest, ACameraIsTriggeredEvery2MmAt100MmPerSecond) {
  machine().setPositionCompare("camera", every(0.002, 0.01, 0.09, 1e-3));
  EXPECT_EQ(shown().axis, "x");
  move(0.1);
  const auto wanted = timesAt(arrivals(), multiples(160, 800, 7200));
  ASSERT_EQ(wanted.size(), 41U);
  expectTimes(switchedOn(), wanted);
  for (std::size_t i = 0; i + 1 < edges().size(); i += 2) {
    EXPECT_EQ(edges()[i + 1].time_ns - edges()[i].time_ns, kMillisecond) << i;
  }
  EXPECT_EQ(shown().compared, 41U);
  EXPECT_EQ(shown().missed, 0U);
  // At the top speed, 2 mm take 20 ms.
  EXPECT_EQ(wanted[21] - wanted[20], 20 * kMillisecond);
  expectAtRest();
}

TEST_F(PositionCompareTest, ItCostsTheAxisNoTime) {
  move(0.05);
  const auto without = arrivals();
  begin();
  machine().setPositionCompare("camera", every(0.00125, 0.0, 0.05, 1e-4));
  move(0.05);
  const auto with_camera = arrivals();
  ASSERT_EQ(with_camera.size(), without.size());
  for (std::size_t i = 1; i < without.size(); ++i) {
    ASSERT_EQ(with_camera[i].time_ns - with_camera[0].time_ns,
              without[i].time_ns - without[0].time_ns);
  }
}

TEST_F(PositionCompareTest, EachPassageCountsOnceInBothDirectionsAndAtReversals) {
  machine().setPositionCompare("camera", at({0.01}, 1e-4));
  move(0.02);
  move(0.0);
  EXPECT_EQ(switchedOn().size(), 2U);
  // Exactly to the place, and on.
  move(0.01);
  EXPECT_EQ(switchedOn().size(), 3U);
  move(0.02);
  EXPECT_EQ(switchedOn().size(), 3U) << "it was there already";
  move(0.01);
  EXPECT_EQ(switchedOn().size(), 4U);
  move(0.0);
  EXPECT_EQ(switchedOn().size(), 4U);
  // To the place and back, then not quite to it.
  move(0.01);
  move(0.0);
  EXPECT_EQ(switchedOn().size(), 5U);
  move(0.01 - kMicrostep);
  move(0.0);
  EXPECT_EQ(switchedOn().size(), 5U);
  expectTimes(switchedOn(), timesAt(arrivals(), {800}));
  EXPECT_EQ(shown().compared, 5U);
}

TEST_F(PositionCompareTest, OneDirectionOnly) {
  PositionCompare up = at({0.01, 0.012}, 1e-4);
  up.direction = Direction::kUp;
  machine().setPositionCompare("camera", up);
  PositionCompare down = at({0.01, 0.012}, 1e-4);
  down.direction = Direction::kDown;
  machine().setPositionCompare("valve", down);
  for (const double target : {0.02, 0.0, 0.011, 0.0105, 0.02, 0.0}) move(target);
  expectTimes(switchedOn(0), timesAt(arrivals(), {800, 960}, 1));
  expectTimes(switchedOn(1), timesAt(arrivals(), {800, 960}, -1));
  EXPECT_EQ(switchedOn(0).size(), 4U);
  EXPECT_EQ(switchedOn(1).size(), 4U);
}

TEST_F(PositionCompareTest, CamsAreOnBetweenTheirPlacesWhereverTheAxisTurns) {
  PositionCompare cams = cam(0.01, 0.012);
  cams.cams.push_back({0.02, 0.021});
  machine().setPositionCompare("valve", cams);
  for (const double target : {0.011, 0.005, 0.03, 0.0205, 0.0}) {
    move(target);
    const std::int64_t count = std::llround(target / kMicrostep);
    const bool inside = (count >= 800 && count <= 960) || (count >= 1600 && count <= 1680);
    EXPECT_EQ(shown(1).on, inside) << target;
  }
  std::vector<std::int64_t> times;
  for (const Edge& edge : edges(1)) times.push_back(edge.time_ns);
  std::vector<std::int64_t> wanted;
  bool was_inside = false;
  for (const Arrival& arrival : arrivals()) {
    const bool inside = (arrival.count >= 800 && arrival.count <= 960) ||
                        (arrival.count >= 1600 && arrival.count <= 1680);
    if (std::exchange(was_inside, inside) != inside) wanted.push_back(arrival.time_ns);
  }
  EXPECT_EQ(wanted.size(), 10U);
  expectTimes(times, wanted);
}

TEST_F(PositionCompareTest, AnAxisThatStandsInACamHasItsOutputOnAtOnce) {
  move(0.011);
  machine().setPositionCompare("valve", cam(0.01, 0.012));
  advance(0.01);
  EXPECT_TRUE(shown(1).on);
  machine().clearPositionCompare("valve");
  advance(0.01);
  EXPECT_FALSE(shown(1).on);
  machine().setOutput("valve", true);
}

TEST_F(PositionCompareTest, LeadsComeEarlierByTheirTimes) {
  PositionCompare early = cam(0.02, 0.04);
  early.lead_on_ns = 20 * kMillisecond;
  early.lead_off_ns = 5 * kMillisecond;
  machine().setPositionCompare("valve", early);
  PositionCompare camera = at({0.02, 0.03}, 1e-3);
  camera.lead_on_ns = 3 * kMillisecond;
  machine().setPositionCompare("camera", camera);
  move(0.06);
  const auto all = edges(1);
  ASSERT_EQ(all.size(), 2U);
  EXPECT_NEAR(static_cast<double>(timesAt(arrivals(), {1600}).at(0) - all[0].time_ns), 20e6, 1.0);
  EXPECT_NEAR(static_cast<double>(timesAt(arrivals(), {3201}).at(0) - all[1].time_ns), 5e6, 1.0);
  const auto shots = switchedOn();
  ASSERT_EQ(shots.size(), 2U);
  EXPECT_NEAR(static_cast<double>(timesAt(arrivals(), {1600}).at(0) - shots[0]), 3e6, 1.0);
  EXPECT_NEAR(static_cast<double>(timesAt(arrivals(), {2400}).at(0) - shots[1]), 3e6, 1.0);
}

// It slows down, or stops, between the lead and the place.
TEST_F(PositionCompareTest, WhatALeadHasBegunIsUndoneIfThePlaceIsNotReached) {
  PositionCompare early = cam(0.03, 0.05);
  early.lead_on_ns = 100 * kMillisecond;
  machine().setPositionCompare("valve", early);
  const axis::Move first = bench->axis("x").moveTo(0.08);
  while (!shown(1).on) advance(1e-4);
  EXPECT_LT(bench->axis("x").state().position, 0.0201);
  machine().setSpeedOverride(0.5);
  advance(0.005);
  EXPECT_TRUE(shown(1).on) << "the same passage, later";
  bench->axis("x").stop();
  bench->axis("x").wait(first);
  advance(0.01);
  ASSERT_LT(bench->axis("x").state().position, 0.03);
  EXPECT_FALSE(shown(1).on);
  ASSERT_EQ(edges(1).size(), 2U);
  move(0.08);
  EXPECT_EQ(edges(1).size(), 4U);
}

TEST_F(PositionCompareTest, TwoOutputsAtOnePlaceAreSwitchedAtOneNanosecond) {
  machine().setPositionCompare("camera", at({0.01, 0.02}));
  machine().setPositionCompare("valve", at({0.01, 0.02}));
  move(0.03);
  EXPECT_EQ(switchedOn(0), switchedOn(1));
  EXPECT_EQ(switchedOn(0).size(), 2U);
}

TEST_F(PositionCompareTest, WithABacklashItIsTheJointThatArrives) {
  axes[0].backlash = 20 * kMicrostep;
  begin();
  machine().setPositionCompare("camera", every(0.001, 0.0, 0.03, 1e-4));
  for (const double target : {0.0105, 0.0102, 0.0108, 0.004, 0.0045, 0.02, 0.0}) move(target);
  expectTimes(switchedOn(), timesAt(arrivals(20), multiples(80, 0, 2400)));
  EXPECT_EQ(shown().missed, 0U);
}

TEST_F(PositionCompareTest, WithAShaperItIsTheShapedMotionThatArrives) {
  axes[0].input_shaper = {{config::ShaperType::kMzv, 25.0, 0.1}};
  axes[0].start_speed = 0.0;
  begin();
  machine().setPositionCompare("camera", every(0.001, 0.0, 0.03, 1e-4));
  const axis::Move first = bench->axis("x").moveTo(0.03);
  advance(0.15);
  bench->axis("x").moveTo(0.005);
  bench->axis("x").wait(first);
  while (bench->axis("x").state().moving) advance(1e-3);
  expectTimes(switchedOn(), timesAt(arrivals(), multiples(80, 0, 2400)));
  EXPECT_GT(switchedOn().size(), 10U);
}

TEST_F(PositionCompareTest, OnACoreXyItIsTheAxisAndNotAMotor) {
  axes = test::coreXyAxes();
  begin();
  machine().setPositionCompare("camera", every(0.001, 0.001, 0.03, 1e-4));
  machine().setPositionCompare("valve", [] {
    PositionCompare compare = every(0.001, 0.001, 0.03, 1e-4);
    compare.axis = "y";
    return compare;
  }());
  machine().wait(machine().moveLine({{"x", "y"}, {0.0203, 0.0102}, false, 0.0}));
  // The motors step at 1.5 and 0.5 of the speed of x, so its place is known to two of their steps.
  EXPECT_EQ(switchedOn(0).size(), 20U);
  EXPECT_EQ(switchedOn(1).size(), 10U);
  const auto a = arrivals(0, "x");
  const auto b = arrivals(0, "y");
  const auto count_at = [](const std::vector<Arrival>& all, std::int64_t time) {
    std::int64_t count = 0;
    for (const Arrival& one : all) {
      if (one.time_ns <= time) count = one.count;
    }
    return static_cast<double>(count);
  };
  for (std::size_t i = 0; i < 20; ++i) {
    const std::int64_t time = switchedOn(0)[i];
    EXPECT_NEAR((count_at(a, time) + count_at(b, time)) / 2.0, 80.0 * (double(i) + 1.0) - 0.5, 1.0);
  }
  machine().wait(machine().moveLine({{"x", "y"}, {0.0, 0.0}, false, 0.0}));
  EXPECT_EQ(switchedOn(0).size(), 40U);
  EXPECT_EQ(shown(0).missed, 0U);
}

// Neither has a target of the axis, nor has what the machine does by itself.
TEST_F(PositionCompareTest, AJogOrAnotherMicrostepModeHasNoEndThatSwitches) {
  axes[0].align_on_microstep_change = true;
  begin();
  PositionCompare end;
  end.axis = "x";
  end.at_end = true;
  end.pulse_ns = kMillisecond;
  machine().setPositionCompare("camera", end);
  axis::Axis& x = bench->axis("x");
  x.jog(0.05);
  advance(0.2);
  x.jog(0.0);
  while (x.state().moving) advance(1e-3);
  advance(0.01);
  EXPECT_TRUE(switchedOn().empty()) << "a jog";
  move((std::round(x.state().position / kMicrostep / 16.0) * 16.0 + 3.0) * kMicrostep);
  advance(0.01);
  EXPECT_EQ(switchedOn().size(), 1U);
  const std::size_t steps = arrivals().size();
  x.setMicrosteps(1);
  advance(0.01);
  EXPECT_NE(arrivals().size(), steps) << "the motor goes to a full step";
  EXPECT_EQ(switchedOn().size(), 1U);
}

TEST_F(PositionCompareTest, AtTheEndOfAMotionButNotOfAHoldOrAStop) {
  PositionCompare end;
  end.axis = "x";
  end.at_end = true;
  end.pulse_ns = kMillisecond;
  machine().setPositionCompare("camera", end);
  const axis::Move first = bench->axis("x").moveTo(0.02);
  advance(0.1);
  machine().hold();
  advance(1.0);
  EXPECT_TRUE(switchedOn().empty());
  machine().resume();
  bench->axis("x").wait(first);
  advance(0.01);
  ASSERT_EQ(switchedOn().size(), 1U);
  EXPECT_GE(switchedOn()[0], arrivals().back().time_ns);
  // The last part of a step takes a while.
  EXPECT_LT(switchedOn()[0], arrivals().back().time_ns + 3 * kMillisecond);
  bench->axis("x").moveTo(0.0);
  advance(0.1);
  bench->axis("x").stop();
  advance(1.0);
  EXPECT_EQ(switchedOn().size(), 1U);
}

// An axis that turns without end is at a place of its positions, and not at the same angle of each
// turn.
TEST_F(PositionCompareTest, ARotaryAxisHasItsPlacesInRad) {
  axes[0].kind = config::Kind::kRotary;
  axes[0].steps_per_unit = 1000.0;
  axes[0].max_speed = 3.0;
  axes[0].acceleration = axes[0].deceleration = 30.0;
  axes[0].start_speed = 0.0;
  axes[0].min_position.reset();
  axes[0].max_position.reset();
  axes[0].continuous = true;
  begin();
  EXPECT_REFUSED(machine().setPositionCompare("camera", at({kNan})), "has a place at nan rad");
  machine().setPositionCompare("camera", at({1.0, 9.0}));
  machine().setPositionCompare("valve", cam(2.0, 2.0 + 2.0 * test::kPi));
  move(10.0);
  move(0.0);
  expectTimes(switchedOn(), timesAt(arrivals(), {1'000, 9'000}));
  EXPECT_EQ(switchedOn().size(), 4U);
  EXPECT_EQ(edges(1).size(), 4U);
  expectTimes(switchedOn(1),
              {timesAt(arrivals(), {2'000}, 1).at(0), timesAt(arrivals(), {8'283}, -1).at(0)});
}

TEST_F(PositionCompareTest, AStopSaysWhatItHasCutOff) {
  machine().setPositionCompare("camera", every(0.002, 0.01, 0.09, 1e-3));
  machine().setPositionCompare("valve", cam(0.08, 0.085));
  const axis::Move first = bench->axis("x").moveTo(0.1);
  while (switchedOn().size() < 10) advance(1e-3);
  bench->axis("x").stop();
  const axis::MoveResult result = bench->axis("x").wait(first);
  EXPECT_EQ(result.end, axis::MoveEnd::kStopped);
  const std::size_t left = 41 - switchedOn().size();
  EXPECT_GT(left, 20U);
  EXPECT_EQ(result.marks_not_made, left + 2);
  EXPECT_NE(result.message.find("; camera wasn't switched at " + std::to_string(left) +
                                " places that weren't reached; valve wasn't switched at 2 places"),
            std::string::npos)
      << result.message;
  const axis::MoveResult rest = bench->axis("x").wait(bench->axis("x").moveTo(0.1));
  EXPECT_EQ(rest.marks_not_made, 0U);
  EXPECT_EQ(switchedOn().size(), 41U);
}

TEST_F(PositionCompareTest, APulseThatCannotBeMadeIsCounted) {
  machine().setPositionCompare("camera", at({0.01}, 0.05));
  // Over the place and back within the pulse.
  move(0.01);
  EXPECT_EQ(shown().compared, 1U);
  move(0.01 + 2 * kMicrostep);
  move(0.01);
  advance(0.1);
  EXPECT_EQ(timesAt(arrivals(), {800}).size(), 2U);
  EXPECT_EQ(shown().compared + shown().missed, 2U);
  EXPECT_EQ(shown().missed, 1U);
  EXPECT_EQ(switchedOn().size(), 1U);
}

TEST_F(PositionCompareTest, AnEmergencyStopLeavesItSafeWithinAMillisecond) {
  machine().setPositionCompare("camera", every(0.01, 0.01, 0.09, 0.05));
  bench->axis("x").moveTo(0.1);
  while (switchedOn().size() < 2) advance(1e-3);
  EXPECT_TRUE(shown().on);
  const std::int64_t asked = bench->clock.now();
  machine().emergencyStop();
  EXPECT_FALSE(shown().on);
  ASSERT_EQ(edges().size(), 4U);
  EXPECT_LE(edges()[3].time_ns - asked, kMillisecond);
  advance(1.0);
  EXPECT_EQ(edges().size(), 4U);
  machine().recover();
  move(0.06);
  EXPECT_EQ(edges().size(), 4U) << "its position can't be trusted";
  bench->axis("x").setPosition(0.0);
  move(0.015);
  EXPECT_EQ(edges().size(), 6U);
}

TEST_F(PositionCompareTest, AFaultOfAnotherAxisMakesItSafeAndTheMotionGoesOnUncompared) {
  axes[1].driver = driver::driverChip("drv8825");
  axes[1].fault = config::FaultPin{"y.fault"};
  begin();
  machine().setPositionCompare("camera", every(0.01, 0.01, 0.09, 0.05));
  const axis::Move first = bench->axis("x").moveTo(0.1);
  while (switchedOn().size() < 2) advance(1e-3);
  bench->axis("y").moveTo(0.1);
  sim::RigFaults over_current;
  over_current.chip_fault_after = 10;
  bench->rig.setFaults("y", over_current);
  while (!bench->axis("x").result(first)) advance(1e-3);
  EXPECT_NE(bench->axis("y").state().fault, "");
  EXPECT_FALSE(shown().on);
  EXPECT_LT(switchedOn().size(), 9U);
  EXPECT_EQ(edges().size() % 2, 0U);
}

TEST_F(PositionCompareTest, ANewOriginAndANewModeMoveThePlaces) {
  machine().setPositionCompare("camera", at({0.01}, 1e-4));
  bench->axis("x").setPosition(0.005);
  move(0.02);
  expectTimes(switchedOn(), timesAt(arrivals(), {400}));
  move(0.005);
  bench->axis("x").setMicrosteps(8);
  move(0.02);
  ASSERT_EQ(switchedOn().size(), 3U);
  EXPECT_EQ(shown().missed, 0U);
}

TEST_F(PositionCompareTest, WhatCannotBeMadeIsRefusedWithTheNumber) {
  axes[0].min_position = 0.0;
  axes[0].max_position = 0.1;
  options.outputs[0].min_off_ns = 2 * kMillisecond;
  options.outputs[1].at_stop = false;
  begin();
  const auto refused = [this](const PositionCompare& compare, const std::string& why,
                              const std::string& output = "camera") {
    EXPECT_REFUSED(machine().setPositionCompare(output, compare), why);
  };
  refused(at({0.05}), "there is no output pump (outputs: camera, valve, bell)", "pump");
  refused(at({0.05}), "the output valve has at_stop: off", "valve");
  PositionCompare other = at({0.05});
  other.axis = "q";
  refused(other, "can't be switched by q: there is no such axis (axes: x, y)");
  refused(at({}), "the output camera has neither cams nor places");
  refused(at({0.11}), "has a place at 0.11 m, but the places of x are 0 m to 0.1 m");
  refused(at({kNan}), "has a place at nan m");
  refused(every(0.0, 0.0, 0.1), "has a distance of 0 m");
  refused(every(kNan, 0.0, 0.1), "has a distance of nan m");
  refused(every(0.01, 0.1, 0.0), "lead upwards");
  refused(every(1e-9, 0.0, 0.1), "places, but can have 1000000 at most");
  refused(every(1e-6, 0.0, 0.1, 1e-5), "a step of x is 1.25e-05 m");
  // 0.2 mm take 2 ms at 100 mm/s.
  refused(every(0.0002, 0.0, 0.1),
          "takes 0.002 s at 0.1 m/s, but a pulse and min_off_ms of it "
          "are 0.003 s");
  refused(at({0.05}, 0.0), "has a pulse of 0 s, but it must be 1e-05 s to 10 s");
  PositionCompare early = every(0.01, 0.0, 0.1);
  early.lead_on_ns = 200 * kMillisecond;
  refused(early, "but the lead is 0.2 s");
  early.lead_on_ns = -1;
  refused(early, "has a lead of on of");
  PositionCompare cams = cam(0.05, 0.04);
  refused(cams, "has a cam from 0.05 m to 0.04 m");
  cams = cam(0.01, 0.02);
  cams.cams.push_back({0.015, 0.03});
  refused(cams, "has cams that overlap, to 0.02 m and from 0.015 m");
  cams.places = {0.01};
  refused(cams, "has cams and pulses");
  bench->axis("x").moveTo(0.1);
  refused(at({0.05}), "x: busy: it moves");
  while (bench->axis("x").state().moving) advance(1e-2);
  EXPECT_TRUE(edges().empty());
}

// The pulses of a servo come every 20 ms, in which x goes 2 mm.
TEST_F(PositionCompareTest, APwmOutputIsNotSwitchedFasterThanItsPulsesCome) {
  options.outputs[0].line = "pwmchip0:0/20000000/1000000/2000000";
  begin();
  const auto refused = [this](const PositionCompare& compare, const std::string& why) {
    EXPECT_REFUSED(machine().setPositionCompare("camera", compare), why);
  };
  refused(at({0.05}, 19e-3), "has a pulse of 0.019 s, but the PWM period of it is 0.02 s");
  refused(every(0.0039, 0.0, 0.1, 20e-3),
          "takes 0.039 s at 0.1 m/s, but a pulse and the PWM period of it are 0.04 s");
  refused(cam(0.01, 0.0119),
          "has a cam of 0.0019 m, for which x takes 0.019 s at 0.1 m/s, but the PWM period of it "
          "is 0.02 s");
  PositionCompare cams = cam(0.01, 0.02);
  cams.cams.push_back({0.0215, 0.03});
  refused(cams, "s at 0.1 m/s, but the PWM period of it is 0.02 s");
  EXPECT_TRUE(edges().empty());
  machine().setPositionCompare("camera", every(0.0041, 0.0041, 0.041, 20e-3));
  move(0.05);
  EXPECT_EQ(shown().compared, 10U);
  EXPECT_EQ(shown().missed, 0U);
  EXPECT_EQ(edges().size(), 20U);
}

TEST_F(PositionCompareTest, NothingElseSwitchesItMeanwhile) {
  machine().setPositionCompare("camera", at({0.01}));
  EXPECT_REFUSED(machine().setOutput("camera", true),
                 "the output camera: the position of x switches it");
  test::PathRequest request{{"x"}, {}, false, 0.0, 0.0};
  request.segments = {test::lineTo({0.01})};
  request.segments[0].outputs = {{"camera", true}};
  EXPECT_REFUSED(followPath(request), "the output camera: the position of x switches it");
  machine().clearPositionCompare("camera");
  machine().setOutput("camera", true);
  EXPECT_TRUE(shown().on);
}

TEST_F(PositionCompareTest, AHundredThousandPlacesCostNoTime) {
  axes[0].steps_per_unit = 8e6;
  axes[0].max_speed = 1e-3;
  axes[0].start_speed = 0.0;
  axes[0].min_position = -1.0;
  begin();
  machine().setPositionCompare("camera", every(1e-6, 0.0, 0.1, 1e-5));
  move(0.1);
  EXPECT_EQ(shown().compared, 100'000U) << "the first place is where it stands";
  EXPECT_EQ(shown().missed, 0U);
  std::vector<std::int64_t> wanted;
  for (const Arrival& arrival : arrivals()) {
    if (arrival.count % 8 == 0) wanted.push_back(arrival.time_ns);
  }
  expectTimes(switchedOn(), wanted);
}

TEST_F(PositionCompareTest, AnOutputThatCannotBeWrittenIsAFaultThatNamesIt) {
  machine().setPositionCompare("camera", every(0.01, 0.01, 0.09));
  const axis::Move first = bench->axis("x").moveTo(0.1);
  while (switchedOn().size() < 2) advance(1e-3);
  bench->rig.failWrites("camera.line", 0, EIO);
  const axis::MoveResult result = bench->axis("x").wait(first);
  EXPECT_EQ(result.end, axis::MoveEnd::kFault) << result.message;
  EXPECT_NE(
      state("x").fault.find("the line camera.line of the output camera can't be written: EIO"),
      std::string::npos)
      << state("x").fault;
  EXPECT_EQ(switchedOn().size(), 2U);
  bench->rig.clearWriteFault("camera.line");
  machine().recover();
  bench->axis("x").setPosition(0.05);
  move(0.075);
  EXPECT_EQ(switchedOn().size(), 4U) << "at 0.06 and 0.07";
}

// As soon as the position has it, without a motion.
TEST_F(PositionCompareTest, AnOutputThatFailsOnceMoreIsAFaultOnceMore) {
  for (int i = 0; i < 3; ++i) {
    bench->rig.failWrites("camera.line", 0, EIO);
    machine().setPositionCompare("camera", cam(-0.01, 0.01));
    advance(1e-3);
    EXPECT_NE(state("x").fault.find("of the output camera can't be written: EIO"),
              std::string::npos)
        << i << ": " << state("x").fault;
    machine().clearPositionCompare("camera");
    bench->rig.clearWriteFault("camera.line");
    machine().recover();
    bench->axis("x").setPosition(0.0);
  }
}

// An axis that stops in a cam, or waits there.
TEST_F(PositionCompareTest, AnOutputThatIsOnForTooLongIsSwitchedOffUntilItsNextPlace) {
  options.outputs[1].max_on_ns = 500 * kMillisecond;
  options.outputs[1].min_off_ns = 10 * kMillisecond;
  begin();
  machine().setPositionCompare("valve", cam(0.01, 0.012));
  move(0.011);
  EXPECT_TRUE(shown(1).on);
  advance(2.0);
  EXPECT_FALSE(shown(1).on);
  ASSERT_EQ(edges(1).size(), 2U);
  EXPECT_EQ(edges(1)[1].time_ns - edges(1)[0].time_ns, 500 * kMillisecond);
  EXPECT_NE(shown(1).note.find("was switched off: it had been on for 0.5 s, the most that "
                               "max_on_s allows"),
            std::string::npos)
      << shown(1).note;
  EXPECT_EQ(state("x").fault, "");
  // It isn't on again in the same cam, and its end has nothing left to do.
  move(0.0115);
  EXPECT_FALSE(shown(1).on);
  move(0.02);
  EXPECT_EQ(edges(1).size(), 2U);
  // The next passage is like any other.
  move(0.0);
  EXPECT_EQ(edges(1).size(), 4U);
  EXPECT_EQ(shown(1).note, "");
  EXPECT_LT(edges(1)[3].time_ns - edges(1)[2].time_ns, 100 * kMillisecond);
}

// A hold in the middle of a cam is as long.
TEST_F(PositionCompareTest, AHoldInACamEndsAtTheLongestTimeOfItsOutput) {
  options.outputs[1].max_on_ns = 500 * kMillisecond;
  begin();
  machine().setPositionCompare("valve", cam(0.01, 0.08));
  const axis::Move first = bench->axis("x").moveTo(0.09);
  while (!shown(1).on) advance(1e-3);
  machine().hold();
  advance(2.0);
  machine().resume();
  EXPECT_EQ(bench->axis("x").wait(first).end, axis::MoveEnd::kReached);
  ASSERT_EQ(edges(1).size(), 2U);
  EXPECT_EQ(edges(1)[1].time_ns - edges(1)[0].time_ns, 500 * kMillisecond);
}

// ---- random motions ----

class RandomPositionCompare : public PositionCompareTest, public testing::WithParamInterface<int> {
 protected:
  double unit() { return std::uniform_real_distribution<double>(0.0, 1.0)(random_); }
  std::int64_t whole(std::int64_t least, std::int64_t most) {
    return std::uniform_int_distribution<std::int64_t>(least, most)(random_);
  }
  bool chance(double probability) { return unit() < probability; }

  void draw() {
    axes = {plotterAxis("x"), plotterAxis("y")};
    play_ = chance(0.5) ? whole(1, 40) : 0;
    axes[0].backlash = static_cast<double>(play_) * kMicrostep;
    axes[0].jerk = chance(0.4) ? 5.0 + 30.0 * unit() : 0.0;
    if (axes[0].jerk > 0.0) axes[0].start_speed = 0.0;
    if (play_ == 0 && chance(0.4)) {
      axes[0].start_speed = 0.0;
      axes[0].input_shaper = {{config::ShaperType::kZv, 20.0 + 60.0 * unit(), 0.1}};
    }
    begin();
    commands_.clear();
    PositionCompare compare = chance(0.5) ? drawEvery() : drawPlaces();
    direction_ = static_cast<int>(whole(-1, 1));
    compare.direction = direction_ == 0  ? Direction::kBoth
                        : direction_ > 0 ? Direction::kUp
                                         : Direction::kDown;
    pulse_ = compare.pulse_ns = whole(10'000, 100'000);
    PositionCompare cams;
    cams.axis = "x";
    cam_from_ = whole(-2000, 1000);
    cam_to_ = cam_from_ + whole(1, 2000);
    cams.cams = {
        {static_cast<double>(cam_from_) * kMicrostep, static_cast<double>(cam_to_) * kMicrostep}};
    leads_ = {};
    if (chance(0.4)) {
      // Neither is longer than the way from one place to the next takes.
      leads_.camera = compare.lead_on_ns = whole(1, 1'000'000);
      cams.lead_on_ns = leads_.on = whole(0, 20'000'000);
      cams.lead_off_ns = leads_.off = whole(0, 20'000'000);
    }
    const bool is_led = test::refusal([&] { machine().setPositionCompare("valve", cams); }).empty();
    if (!is_led) {
      cams.lead_on_ns = cams.lead_off_ns = leads_.on = leads_.off = 0;
      machine().setPositionCompare("valve", cams);
    }
    machine().setPositionCompare("camera", compare);
    PositionCompare end;
    end.axis = "x";
    end.at_end = true;
    end.pulse_ns = 10'000;
    machine().setPositionCompare("bell", end);
    moves_.clear();
    is_judged_ = true;
    advance(0.001);
  }

  PositionCompare drawPlaces() {
    PositionCompare compare;
    compare.axis = "x";
    counts_.clear();
    std::int64_t count = -whole(0, 4000);
    const std::int64_t last = whole(500, 5000);
    while (count < last) {
      counts_.push_back(count);
      compare.places.push_back(static_cast<double>(count) * kMicrostep);
      count += chance(0.5) ? 12 + whole(0, 8) : whole(20, 800);
    }
    return compare;
  }
  // Its places are the nearest microsteps.
  PositionCompare drawEvery() {
    const double distance = (chance(0.5) ? 12.0 + 20.0 * unit() : 500.0 * unit() + 20.0);
    const double from = -4000.0 * unit();
    const double to = from + distance * (1.0 + 8000.0 / distance * unit());
    counts_.clear();
    for (int i = 0; from + i * distance <= to; ++i) {
      counts_.push_back(std::llround(from + i * distance));
    }
    return every(distance * kMicrostep, from * kMicrostep, to * kMicrostep);
  }

  // What is judged: from a time at which the axis rests, to another one or an emergency stop.
  struct Phase {
    std::int64_t from = 0;
    std::int64_t until = std::numeric_limits<std::int64_t>::max();
    std::uint64_t compared = 0;  // before it, by the outputs
    std::uint64_t missed = 0;
    bool is_cut = false;  // by an emergency stop
  };
  void disturb() {
    axis::Axis& x = bench->axis("x");
    const double what = unit();
    commands_.push_back(bench->clock.now());
    if (what < 0.45) {
      moveTo(-0.04 + 0.09 * unit(), chance(0.5) ? 0.0 : 0.02 + 0.08 * unit());
    } else if (what < 0.55) {
      moveTo(static_cast<double>(counts_[static_cast<std::size_t>(
                 whole(0, static_cast<std::int64_t>(counts_.size()) - 1))]) *
             kMicrostep);
    } else if (what < 0.65) {
      x.jog(-0.1 + 0.2 * unit());
    } else if (what < 0.75) {
      machine().setSpeedOverride(0.1 + 0.9 * unit());
    } else if (what < 0.9) {
      machine().hold();
      if (chance(0.7)) advance(0.2 * unit());
      commands_.push_back(bench->clock.now());
      machine().resume();
    } else {
      x.stop();
      judgeStop();
    }
    ++motions_;
  }
  void moveTo(double target, double velocity = 0.0) {
    const axis::Move move = bench->axis("x").moveTo(target, false, velocity);
    moves_.push_back({move, std::llround(target / kMicrostep)});
    is_judged_ = false;
  }

  // What the last move says that it has left out: places and edges of the cam that are beyond the
  // joint.
  void judgeStop() {
    if (std::exchange(is_judged_, true)) return;
    const auto& [move, target] = moves_.back();
    for (int i = 0; i < 1000 && !bench->axis("x").result(move); ++i) advance(1e-3);
    const auto result = bench->axis("x").result(move);
    ASSERT_TRUE(result);
    if (result->end != axis::MoveEnd::kStopped) return;
    const auto all = arrivals(play_);
    const std::int64_t at = all.empty() ? 0 : all.back().count;
    std::uint64_t left = 0;
    const int way = target > at ? 1 : -1;
    for (std::int64_t count = at; count != target;) {
      const bool was_inside = isInCam(count);
      count += way;
      if (isInCam(count) != was_inside) ++left;
      if (isPlace({0, count, way})) ++left;
    }
    EXPECT_EQ(result->marks_not_made, left) << result->message;
    left_out_ += static_cast<int>(left);
  }

  // Each motion that has reached its target rings once, at its end.
  void judgeBell(const Phase& phase) {
    std::vector<std::int64_t> rung;
    for (const Edge& edge : edgesIn(phase, 2)) {
      if (edge.on) rung.push_back(edge.time_ns);
    }
    // A move to where the axis is, too.
    const auto reached = std::count_if(moves_.begin(), moves_.end(), [this](const auto& each) {
      const auto result = bench->axis("x").result(each.first);
      return result && result->end == axis::MoveEnd::kReached;
    });
    ASSERT_EQ(rung.size(), static_cast<std::size_t>(reached));
    const auto steps = arrivals();
    // [s] The motor's way of so many steps before its end.
    const auto before_end = [this](double count) {
      const config::AxisConfig& x = axes[0];
      const double v = x.start_speed;
      const double way = count * kMicrostep;
      return (std::sqrt(v * v + 2.0 * x.deceleration * way) - v) / x.deceleration;
    };
    const bool is_plain = axes[0].jerk == 0.0 && axes[0].input_shaper.empty();
    const double ramp = 1e9 * (before_end(1.5) - before_end(0.5));
    for (const std::int64_t time : rung) {
      const auto after = std::find_if(steps.begin(), steps.end(),
                                      [&](const Arrival& step) { return step.time_ns > time; });
      if (after - steps.begin() < 2) continue;  // a way of one step has no speed
      const std::int64_t last = (after - 1)->time_ns;
      // A hold may have ended in the last half step.
      if (isCommanded(last, time)) continue;
      // As long as the last half step may take with a shaper.
      ASSERT_LE(time - last, 60 * kMillisecond);
      const double interval = static_cast<double>(last - (after - 2)->time_ns);
      if (!is_plain || std::abs(interval - ramp) > 2.0) continue;
      ASSERT_LE(std::abs(time - last - std::llround(1e9 * before_end(0.5))), 1) << time;
      ++exact_ends_;
    }
    moves_.clear();
    is_judged_ = true;
  }

  void disturbOften() {
    for (int i = 0; i < 20; ++i) {
      test::refusal([this] { disturb(); });
      advance(0.4 * unit());
    }
  }

  Phase phaseFromNow(int output) {
    Phase phase;
    phase.from = bench->clock.now();
    phase.compared = shown(static_cast<std::size_t>(output)).compared;
    phase.missed = shown(static_cast<std::size_t>(output)).missed;
    return phase;
  }
  bool isPlace(const Arrival& arrival) const {
    return std::binary_search(counts_.begin(), counts_.end(), arrival.count) &&
           (direction_ == 0 || direction_ == arrival.direction);
  }
  bool isInCam(std::int64_t count) const { return count >= cam_from_ && count <= cam_to_; }
  static std::int64_t countAt(const std::vector<Arrival>& all, std::int64_t time_ns) {
    std::int64_t count = 0;
    for (const Arrival& arrival : all) {
      if (arrival.time_ns <= time_ns) count = arrival.count;
    }
    return count;
  }
  std::vector<Edge> edgesIn(const Phase& phase, std::size_t output) const {
    std::vector<Edge> own;
    for (const Edge& edge : edges(output)) {
      const bool after_cut = phase.is_cut && edge.time_ns > phase.until;
      if (edge.time_ns >= phase.from && (edge.time_ns <= phase.until || after_cut)) {
        own.push_back(edge);
      }
    }
    return own;
  }
  // An emergency stop switches off what is on, within a millisecond, and nothing else follows.
  static void cutOff(const Phase& phase, std::vector<Edge>& own) {
    if (!phase.is_cut || own.empty() || own.back().time_ns < phase.until) return;
    ASSERT_FALSE(own.back().on);
    ASSERT_LE(own.back().time_ns - phase.until, kMillisecond);
    own.pop_back();
    ASSERT_FALSE(own.empty());
    ASSERT_LT(own.back().time_ns, phase.until) << "more than one edge after an emergency stop";
    ASSERT_TRUE(own.back().on);
  }

  // What the trace says that the camera should have done.
  void judgeCamera(const Phase& phase, const std::vector<Arrival>& all) {
    std::vector<Edge> own = edgesIn(phase, 0);
    ASSERT_NO_FATAL_FAILURE(cutOff(phase, own));
    std::vector<std::int64_t> on;
    std::uint64_t missed = 0;
    std::int64_t off = std::numeric_limits<std::int64_t>::min();
    for (const Arrival& arrival : all) {
      if (arrival.time_ns < phase.from || arrival.time_ns > phase.until) continue;
      if (!isPlace(arrival)) continue;
      if (arrival.time_ns <= off) {
        ++missed;
      } else {
        on.push_back(arrival.time_ns);
        off = arrival.time_ns + pulse_;
      }
    }
    std::vector<std::int64_t> made;
    for (std::size_t i = 0; i < own.size(); ++i) {
      ASSERT_EQ(own[i].on, i % 2 == 0);
      if (own[i].on) made.push_back(own[i].time_ns);
      if (own[i].on) continue;
      ASSERT_LE(std::abs(own[i].time_ns - own[i - 1].time_ns - pulse_), 1);
    }
    marks_ += static_cast<int>(on.size());
    if (leads_.camera > 0) return judgeLed(on, made, leads_.camera, on);
    expectTimes(made, on);
    ASSERT_EQ(shown().compared - phase.compared, on.size());
    ASSERT_EQ(shown().missed - phase.missed, missed);
  }

  void judgeValve(const Phase& phase, const std::vector<Arrival>& all) {
    std::vector<Edge> own = edgesIn(phase, 1);
    ASSERT_NO_FATAL_FAILURE(cutOff(phase, own));
    bool inside = isInCam(countAt(all, phase.from));
    std::array<std::vector<std::int64_t>, 2> wanted;
    std::array<std::vector<std::int64_t>, 2> made;
    std::vector<std::int64_t> passages;
    if (inside && !own.empty() && own.front().on) own.erase(own.begin());  // where it stands
    for (const Edge& edge : own) made[edge.on ? 1 : 0].push_back(edge.time_ns);
    for (const Arrival& arrival : all) {
      if (arrival.time_ns < phase.from || arrival.time_ns > phase.until) continue;
      const bool is_inside = isInCam(arrival.count);
      if (std::exchange(inside, is_inside) == is_inside) continue;
      wanted[is_inside ? 1 : 0].push_back(arrival.time_ns);
      passages.push_back(arrival.time_ns);
    }
    marks_ += static_cast<int>(wanted[0].size() + wanted[1].size());
    for (const std::size_t on : {0U, 1U}) {
      const std::int64_t lead = on == 1 ? leads_.on : leads_.off;
      if (leads_.on + leads_.off > 0) {
        ASSERT_NO_FATAL_FAILURE(judgeLed(wanted[on], made[on], lead, passages));
      } else {
        ASSERT_NO_FATAL_FAILURE(expectTimes(made[on], wanted[on]));
      }
    }
  }

  bool isCommanded(std::int64_t from, std::int64_t until) const {
    return std::any_of(commands_.begin(), commands_.end(), [&](std::int64_t time) {
      return time >= from - 2 * kMillisecond && time <= until;
    });
  }

  // An action comes a lead before its passage, unless a command comes in between: then it only
  // comes before the passage. One without a passage needs a command that has prevented it.
  void judgeLed(const std::vector<std::int64_t>& passages, const std::vector<std::int64_t>& made,
                std::int64_t lead, const std::vector<std::int64_t>& of_any_kind) {
    std::vector<std::int64_t> free = made;
    for (const std::int64_t passage : passages) {
      const bool follows =
          std::any_of(of_any_kind.begin(), of_any_kind.end(), [&](std::int64_t before) {
            return before < passage && before + pulse_ >= passage - lead - 1;
          });
      if (follows || isCommanded(passage - lead, passage)) continue;
      // It may have come even earlier, before a command that has made the axis slower.
      const auto found = std::find_if(free.begin(), free.end(), [&](std::int64_t time) {
        return std::abs(time - (passage - lead)) <= 1 ||
               (time < passage - lead && isCommanded(time, passage) &&
                std::none_of(of_any_kind.begin(), of_any_kind.end(),
                             [&](std::int64_t other) { return other > time && other < passage; }));
      });
      ASSERT_NE(found, free.end()) << "no action " << lead << " ns before " << passage;
      free.erase(found);
      ++led_;
    }
    for (const std::int64_t time : free) {
      const bool has_passage = std::any_of(
          passages.begin(), passages.end(),
          [&](std::int64_t passage) { return passage >= time - 1 && passage <= time + lead + 1; });
      ASSERT_TRUE(has_passage || isCommanded(time - lead, time + lead + kMillisecond))
          << "an action at " << time;
    }
  }

  std::mt19937 random_;
  std::int64_t play_ = 0;
  std::vector<std::int64_t> counts_;
  int direction_ = 0;
  std::int64_t pulse_ = 0;
  std::int64_t cam_from_ = 0;
  std::int64_t cam_to_ = 0;
  struct {
    std::int64_t camera = 0;
    std::int64_t on = 0;
    std::int64_t off = 0;
  } leads_;
  std::vector<std::int64_t> commands_;
  std::vector<std::pair<axis::Move, std::int64_t>> moves_;  // with their targets [microsteps]
  int motions_ = 0;
  int marks_ = 0;
  int led_ = 0;
  bool is_judged_ = true;  // what the last move has left out
  int left_out_ = 0;       // places that stopped moves have told of
  int exact_ends_ = 0;     // motions whose end was checked to the nanosecond
};

TEST_P(RandomPositionCompare, EachPassageComesOnceAtItsNanosecondOrIsCounted) {
  const int runs = test::runsOf("STEPDRIVER_MOTIONS", 50);
  for (int run = 0; run < runs; ++run) {
    const int number = GetParam() * 10'000 + run;
    SCOPED_TRACE(number);
    random_.seed(static_cast<unsigned>(number));
    ASSERT_NO_FATAL_FAILURE(draw());
    std::array<Phase, 3> phases{};  // one for each output
    disturbOften();
    if (chance(0.3)) {
      const std::int64_t asked = bench->clock.now();
      for (Phase& phase : phases) {
        phase.until = asked;
        phase.is_cut = true;
      }
      commands_.push_back(asked);
      machine().emergencyStop();
      EXPECT_FALSE(shown(0).on);
      EXPECT_FALSE(shown(1).on);
      EXPECT_FALSE(shown(2).on);
      advance(0.1);
      auto all = arrivals(play_);
      ASSERT_NO_FATAL_FAILURE(judgeCamera(phases[0], all));
      ASSERT_NO_FATAL_FAILURE(judgeValve(phases[1], all));
      ASSERT_NO_FATAL_FAILURE(judgeBell(phases[2]));
      // From the place where it stands, they are switched again.
      machine().recover();
      machine().setSpeedOverride(1.0);
      for (int output : {0, 1, 2}) phases[static_cast<std::size_t>(output)] = phaseFromNow(output);
      commands_.push_back(bench->clock.now());
      bench->axis("x").setPosition(static_cast<double>(countAt(all, asked + kSecond)) * kMicrostep);
      advance(0.001);
      disturbOften();
    }
    commands_.push_back(bench->clock.now());
    test::refusal([this] { machine().stop(); });
    advance(1.0);
    const auto all = arrivals(play_);
    ASSERT_NO_FATAL_FAILURE(judgeCamera(phases[0], all));
    ASSERT_NO_FATAL_FAILURE(judgeValve(phases[1], all));
    ASSERT_NO_FATAL_FAILURE(judgeBell(phases[2]));
    EXPECT_EQ(shown(1).on, isInCam(all.empty() ? 0 : all.back().count));
  }
  RecordProperty("motions", motions_);
  RecordProperty("marks", marks_);
  RecordProperty("led", led_);
  RecordProperty("left_out", left_out_);
  RecordProperty("exact_ends", exact_ends_);
  EXPECT_GT(led_, runs);
  EXPECT_GT(marks_, 20 * runs);
  EXPECT_GT(left_out_, runs);
  EXPECT_GT(exact_ends_, runs / 4);
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomPositionCompare, testing::Range(0, 10));

// ---- axes that share motors ----

// Between two steps of its motors the place of an axis is known to within an error. The camera
// must fire whenever x comes into one of its places, and only then; the valve must be on while y is
// in its cam.
class RandomCoreXyCompare : public RandomPositionCompare {
 protected:
  void drawCoreXy() {
    axes = test::coreXyAxes();
    for (config::AxisConfig& axis : axes) {
      axis.jerk = chance(0.3) ? 20.0 : 0.0;
      if (axis.jerk == 0.0 && chance(0.3)) {
        axis.input_shaper = {{config::ShaperType::kZv, 20.0 + 60.0 * unit(), 0.1}};
      }
    }
    begin();
    PositionCompare camera = drawEvery();
    pulse_ = camera.pulse_ns = 10'000;
    machine().setPositionCompare("camera", camera);
    PositionCompare cams;
    cams.axis = "y";
    cam_from_ = whole(-2000, 1000);
    cam_to_ = cam_from_ + whole(20, 2000);
    cams.cams = {
        {static_cast<double>(cam_from_) * kMicrostep, static_cast<double>(cam_to_) * kMicrostep}};
    machine().setPositionCompare("valve", cams);
    advance(0.001);
  }

  void disturbCoreXy() {
    const double what = unit();
    const auto place = [&] { return -0.04 + 0.09 * unit(); };
    const std::string one = chance(0.5) ? "x" : "y";
    if (what < 0.3) {
      machine().moveLine({{"x", "y"}, {place(), place()}, false, 0.0});
    } else if (what < 0.6) {
      bench->axis(one).moveTo(place());
    } else if (what < 0.7) {
      bench->axis(one).jog(-0.1 + 0.2 * unit());
    } else if (what < 0.8) {
      machine().setSpeedOverride(0.1 + 0.9 * unit());
    } else if (what < 0.9) {
      machine().hold();
      if (chance(0.7)) advance(0.2 * unit());
      machine().resume();
    } else {
      bench->axis(one).stop();
    }
    ++motions_;
  }

  // [microsteps] Of what is compared with the place of an axis by its motors.
  static constexpr double kRounding = 0.02;

  /// @param until an emergency stop makes them safe then
  void judgeCoreXy(std::int64_t until) {
    const test::TracedAxes traced(*bench->trace, axes);
    std::vector<std::int64_t> times;
    for (const std::string name : {"x", "y"}) {
      for (const Arrival& step : arrivals(0, name)) times.push_back(step.time_ns);
    }
    std::sort(times.begin(), times.end());
    while (!times.empty() && times.back() > until) times.pop_back();
    std::vector<std::int64_t> fired = switchedOn();
    std::optional<std::size_t> at_place;  // the last place that it came into
    bool has_left = true;
    std::size_t next = 0;
    if (const auto start = std::find(counts_.begin(), counts_.end(), 0); start != counts_.end()) {
      at_place = static_cast<std::size_t>(start - counts_.begin());
      has_left = false;
    }
    const auto of = [&](std::size_t place) { return static_cast<double>(counts_[place]); };
    for (std::size_t i = 0; i < times.size(); ++i) {
      while (next < fired.size() && fired[next] <= times[i]) {
        const test::KnownPlace at = traced.at(0, static_cast<double>(fired[next]));
        const auto place = nearestPlace(at.place);
        const double edge = std::abs(at.place - of(place));
        ASSERT_NEAR(edge, 0.5, at.error + kRounding) << "fired at " << fired[next];
        if (at_place) {
          ASSERT_LE(std::abs(static_cast<double>(place) - static_cast<double>(*at_place)), 1.0);
        }
        at_place = place;
        has_left = false;
        ++next;
        ++marks_;
      }
      const test::KnownPlace x = traced.at(0, static_cast<double>(times[i]));
      const double may = x.error + kRounding;
      const std::size_t near = nearestPlace(x.place);
      const bool is_in = std::abs(x.place - of(near)) < 0.5 - may;
      const bool is_out = !at_place || std::abs(x.place - of(*at_place)) > 0.5 + may;
      ASSERT_FALSE(is_in && (near != at_place.value_or(counts_.size()) || has_left))
          << "the camera missed " << counts_[near] << " at " << times[i];
      has_left = has_left || is_out;
    }
    ASSERT_EQ(next, fired.size());
    judgeCam(traced, times, until);
  }

  void judgeCam(const test::TracedAxes& traced, const std::vector<std::int64_t>& times,
                std::int64_t until) {
    const double middle = static_cast<double>(cam_from_ + cam_to_) / 2.0;
    const double half = static_cast<double>(cam_to_ - cam_from_) / 2.0 + 0.5;
    const std::vector<Edge> valve = edges(1);
    std::size_t next = 0;
    bool on = false;
    for (const std::int64_t time : times) {
      for (; next < valve.size() && valve[next].time_ns <= std::min(time, until); ++next) {
        on = valve[next].on;
        if (valve[next].time_ns < times.front()) continue;  // it stood in the cam
        const auto at = traced.at(1, static_cast<double>(valve[next].time_ns));
        ASSERT_NEAR(std::abs(at.place - middle), half, at.error + kRounding);
        ++marks_;
      }
      const test::KnownPlace y = traced.at(1, static_cast<double>(time));
      const double inside = half - std::abs(y.place - middle);
      if (std::abs(inside) < y.error + kRounding) continue;
      ASSERT_EQ(on, inside > 0.0) << time;
    }
  }

  std::size_t nearestPlace(double count) const {
    const auto after = std::lower_bound(counts_.begin(), counts_.end(), count);
    if (after == counts_.begin()) return 0;
    const auto number = static_cast<std::size_t>(after - counts_.begin());
    if (after == counts_.end()) return number - 1;
    const double before = static_cast<double>(counts_[number - 1]);
    return static_cast<double>(*after) - count < count - before ? number : number - 1;
  }
};

TEST_P(RandomCoreXyCompare, EachPassageOfAnAxisComesOnce) {
  const int runs = test::runsOf("STEPDRIVER_MOTIONS", 15);
  for (int run = 0; run < runs; ++run) {
    const int number = GetParam() * 10'000 + run;
    SCOPED_TRACE(number);
    random_.seed(static_cast<unsigned>(number));
    drawCoreXy();
    for (int i = 0; i < 15; ++i) {
      test::refusal([this] { disturbCoreXy(); });
      advance(0.4 * unit());
    }
    const std::int64_t asked = bench->clock.now();
    const bool is_emergency = chance(0.3);
    if (is_emergency) {
      machine().emergencyStop();
    } else {
      test::refusal([this] { machine().stop(); });
    }
    advance(1.0);
    ASSERT_NO_FATAL_FAILURE(
        judgeCoreXy(is_emergency ? asked : std::numeric_limits<std::int64_t>::max()));
    if (!is_emergency) continue;
    for (const std::size_t output : {0U, 1U}) {
      ASSERT_FALSE(shown(output).on);
      const auto all = edges(output);
      if (all.empty() || all.back().time_ns <= asked) continue;
      ASSERT_FALSE(all.back().on);
      ASSERT_LE(all.back().time_ns - asked, kMillisecond);
    }
  }
  RecordProperty("motions", motions_);
  RecordProperty("marks", marks_);
  EXPECT_GT(marks_, runs);
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomCoreXyCompare, testing::Range(0, 4));

}  // namespace
}  // namespace stepdriver
