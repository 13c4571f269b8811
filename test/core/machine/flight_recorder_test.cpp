#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/recording.h"
#include "support/bench.h"

// The recorder of a machine, compared with what the rig has seen.

namespace stepdriver {
namespace {

using machine::Recording;
using test::Bench;
using test::linearAxis;

using Levels = std::map<std::string, bool>;  // by "axis.pin"
/// At each time, the new level of each pin that changed: the order within an instant means nothing.
using Changes = std::map<std::int64_t, Levels>;

struct Seen {
  Levels levels;
  Changes changes;
};

/// From a time on, and until another.
Seen seenByRig(const Bench& bench, std::int64_t begin, std::int64_t end) {
  const sim::MemoryTrace& trace = *bench.trace;
  Seen seen;
  const auto name_of = [&](int pin) {
    const sim::TracePin& traced = trace.pins()[static_cast<std::size_t>(pin)];
    return traced.scope + "." + traced.variable;
  };
  const auto is_output = [](const std::string& name) {
    return name.find("endstop") == std::string::npos && name.find("fault") == std::string::npos;
  };
  for (std::size_t i = 0; i < trace.pins().size(); ++i) {
    const std::string name = name_of(static_cast<int>(i));
    if (is_output(name)) seen.levels[name] = trace.levels()[i];
  }
  for (const sim::MemoryTrace::Edge& edge : trace.edges()) {
    const std::string name = name_of(edge.pin);
    if (!is_output(name) || edge.time_ns > end) continue;
    if (edge.time_ns < begin) {
      seen.levels[name] = edge.level;
    } else {
      seen.changes[edge.time_ns][name] = edge.level;
    }
  }
  return seen;
}

Seen seenByRecorder(const Recording& recording) {
  Seen seen;
  for (const Recording::Pin& pin : recording.pins) {
    const std::string name = pin.axis + "." + pin.name;
    seen.levels[name] = recording.levels.at(static_cast<std::size_t>(pin.output));
    for (const Recording::Edge& edge : recording.edges) {
      if (edge.output == pin.output) seen.changes[edge.time][name] = edge.level;
    }
  }
  return seen;
}

std::size_t countOf(const Changes& changes) {
  std::size_t count = 0;
  for (const auto& [time, levels] : changes) count += levels.size();
  return count;
}

std::string textOf(const Recording& recording) {
  std::string text;
  for (const Recording::Event& event : recording.events) {
    text += std::to_string(event.time) + " " + event.text + "\n";
  }
  return text;
}

class FlightRecorderTest : public testing::Test {
 protected:
  Bench& start(const std::vector<config::AxisConfig>& axes, bool threaded = false,
               double speed = 0.0) {
    options_.record_seconds = seconds_;
    bench_ = std::make_unique<Bench>(axes, Bench::rigAxes(axes), threaded, speed, options_);
    return *bench_;
  }

  /// Compares the recording with the rig's trace. @return the number of edges.
  std::size_t compare() {
    const Recording recording = bench_->machine->recording();
    const Seen expected = seenByRig(*bench_, recording.begin, recording.end);
    const Seen seen = seenByRecorder(recording);
    EXPECT_EQ(seen.levels, expected.levels);
    EXPECT_EQ(countOf(seen.changes), countOf(expected.changes));
    EXPECT_TRUE(seen.changes == expected.changes) << textOf(recording);
    return countOf(seen.changes);
  }

  void expectEvent(const std::string& words) {
    const std::string text = textOf(bench_->machine->recording());
    EXPECT_NE(text.find(words), std::string::npos) << "no event says: " << words << "\n" << text;
  }

  double seconds_ = 600.0;
  machine::MachineOptions options_;
  std::unique_ptr<Bench> bench_;
};

TEST_F(FlightRecorderTest, HasEveryEdgeOfMovesThatTheRigHasSeen) {
  Bench& bench = start({linearAxis("x"), linearAxis("y", "tb6600")});
  bench.move(0.01);
  bench.move(-0.002);
  const axis::Move both = bench.axis("x").moveTo(0.02);
  bench.move(0.015, "y");
  bench.axis("x").wait(both);
  EXPECT_EQ(bench.pulses("x"), 1'600);
  EXPECT_GT(compare(), 2U * (800 + 960 + 1'760 + 1'200));
}

TEST_F(FlightRecorderTest, HasEveryEdgeOfALineAHomingAndAnEmergencyStop) {
  config::AxisConfig x = linearAxis("x");
  x.homing.emplace();
  x.homing->seek_speed = 0.05;
  x.homing->latch_speed = 0.005;
  x.homing->pull_off = 0.002;
  x.homing->max_travel = 0.3;
  Bench& bench = start({x, linearAxis("y")});
  bench.machine->home({"x"});
  motion::LineRequest line;
  line.names = {"x", "y"};
  line.positions = {0.02, 0.03};
  line.relative = true;
  bench.machine->wait(bench.machine->moveLine(line));
  bench.axis("x").setMicrosteps(8);
  bench.axis("y").sleep(true);
  bench.axis("y").sleep(false);
  bench.axis("x").moveTo(0.05, true);
  bench.machine->advance(0.1);
  bench.machine->emergencyStop();
  bench.machine->recover();
  bench.axis("y").enable(false);
  EXPECT_GT(compare(), 10'000U);
  for (const char* words :
       {"home x", "line x by 0.02 m, y by 0.03 m", "x: 8 microsteps", "y: sleep", "y: wake",
        "move x by 0.05 m", "emergency stop", "x: fault: emergency stop", "recover",
        "x: no fault anymore", "disable y", "was ended by an emergency stop"}) {
    expectEvent(words);
  }
}

TEST_F(FlightRecorderTest, HasEveryEdgeOfAMachineWithThreads) {
  Bench& bench = start({linearAxis("x"), linearAxis("y")}, true, 20.0);
  const axis::Move both = bench.axis("x").moveTo(0.02);
  bench.move(0.015, "y");
  bench.axis("x").wait(both);
  bench.axis("x").enable(false);
  bench.axis("x").enable(true);
  EXPECT_GT(compare(), 2U * (1'600 + 1'200));
}

TEST_F(FlightRecorderTest, HasOnlyTheLastSecondsWithTheLevelsAtTheirBeginning) {
  seconds_ = 0.05;
  Bench& bench = start({linearAxis("x")});
  bench.axis("x").moveTo(0.09);
  bench.machine->advance(0.5);
  for (int i = 0; i < 40; ++i) {
    bench.machine->advance(0.000'031);
    const Recording recording = bench.machine->recording();
    EXPECT_EQ(recording.end - recording.begin, 50'000'000);
    EXPECT_FALSE(recording.shortened);
    EXPECT_GT(compare(), 600U);
  }
}

TEST_F(FlightRecorderTest, SaysThatItBeginsLaterIfTheMemoryIsFull) {
  options_.record_bytes = std::size_t{8} * 131'072;
  Bench& bench = start({linearAxis("x")});
  EXPECT_NEAR(bench.machine->recordedSeconds(), 131'072 / 16'000.0, 1e-9);
  for (int i = 0; i < 5; ++i) {
    bench.move(0.09);
    bench.move(-0.09);
  }
  const Recording recording = bench.machine->recording();
  EXPECT_TRUE(recording.shortened);
  EXPECT_GE(recording.edges.size(), 131'072U);
  EXPECT_LT(recording.edges.size(), 131'500U);
  EXPECT_EQ(compare(), recording.edges.size());
}

TEST_F(FlightRecorderTest, SaysWhatWasAskedWhatWasAnsweredAndWhatWasPlanned) {
  Bench& bench = start({linearAxis("x")});
  bench.move(0.01);
  EXPECT_THROW(bench.axis("x").moveTo(0.02, false, 0.5), Refused);
  expectEvent("move x to 0.01 m");
  expectEvent("move x to 0.02 m, velocity 0.5 m/s");
  expectEvent("refused: x: the velocity");
  expectEvent("motor from count 0 (0 m) to 800 (0.01 m) in ");
  expectEvent("reached its end at count 800");
}

TEST_F(FlightRecorderTest, TellsOfAFault) {
  Bench& bench = start({linearAxis("x")});
  int told = 0;
  bench.machine->onFault([&told] { ++told; });
  bench.move(0.01);
  EXPECT_EQ(told, 0);
  bench.rig.failWrites("x.step", 100, EIO);
  EXPECT_EQ(bench.move(0.0).end, axis::MoveEnd::kFault);
  EXPECT_EQ(told, 1);
  expectEvent("x: fault: ");
  compare();
  int late = 0;
  bench.machine->onFault([&late] { ++late; });
  EXPECT_EQ(late, 1) << "there was a fault before";
}

TEST_F(FlightRecorderTest, IsRefusedIfNothingIsRecorded) {
  seconds_ = 0.0;
  Bench& bench = start({linearAxis("x")});
  EXPECT_THROW(bench.machine->recording(), Refused);
}

}  // namespace
}  // namespace stepdriver
