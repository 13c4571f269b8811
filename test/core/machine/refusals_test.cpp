#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <exception>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/step_rates.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/homing_bench.h"

// Whatever a program asks of the core, only an Error comes out of it, and it says why.

namespace stepdriver {
namespace {

using test::Bench;
using test::kInfinity;
using test::kNan;

struct Call {
  std::string name;
  std::function<void(Bench&)> call;
};

const std::vector<double>& oddNumbers() {
  static const std::vector<double> all = {
      0.0,       -0.0,       5e-324, -5e-324,    1e-9,   0.05,
      -0.05,     1e9,        -1e9,   1e300,      -1e300, kNan,
      kInfinity, -kInfinity, 0x1p53, -0x1.8p+63, 1.0,    std::numeric_limits<double>::max()};
  return all;
}

std::vector<Call> callsOfAnAxis(double number) {
  const std::string text = std::to_string(number);
  return {
      {"moveTo " + text, [=](Bench& bench) { bench.axis().moveTo(number); }},
      {"moveTo by " + text, [=](Bench& bench) { bench.axis().moveTo(number, true); }},
      {"moveTo at " + text, [=](Bench& bench) { bench.axis().moveTo(0.01, false, number); }},
      {"moveTo shortest " + text,
       [=](Bench& bench) { bench.axis().moveTo(number, false, 0.0, true); }},
      {"plan " + text, [=](Bench& bench) { bench.axis().plan(number); }},
      {"moveRounds " + text, [=](Bench& bench) { bench.axis().moveRounds(number); }},
      {"jog " + text, [=](Bench& bench) { bench.axis().jog(number); }},
      {"setPosition " + text, [=](Bench& bench) { bench.axis().setPosition(number); }},
      {"setLimits speed " + text,
       [=](Bench& bench) {
         bench.axis().setLimits({number, 1.0, 1.0, 0.0});
       }},
      {"setLimits acceleration " + text,
       [=](Bench& bench) {
         bench.axis().setLimits({0.1, number, 1.0, 0.0});
       }},
      {"setLimits deceleration " + text,
       [=](Bench& bench) {
         bench.axis().setLimits({0.1, 1.0, number, 0.0});
       }},
      {"setLimits jerk " + text,
       [=](Bench& bench) {
         bench.axis().setLimits({0.1, 1.0, 1.0, number});
       }},
      {"setMicrosteps " + text,
       [=](Bench& bench) {
         bench.axis().setMicrosteps(std::abs(number) < 1e6 ? static_cast<int>(number) : -1);
       }},
      {"sleep", [](Bench& bench) { bench.axis().sleep(true); }},
      {"wake", [](Bench& bench) { bench.axis().sleep(false); }},
      {"reset", [](Bench& bench) { bench.axis().reset(); }},
      {"disable", [](Bench& bench) { bench.axis().enable(false); }},
      {"enable", [](Bench& bench) { bench.axis().enable(true); }},
      {"home", [](Bench& bench) { bench.axis().home(); }},
      {"home one that has no homing", [](Bench& bench) { bench.axis("y").home(); }},
      {"checkHoming", [](Bench& bench) { bench.axis().checkHoming(); }},
      {"endstops", [](Bench& bench) { bench.axis().endstops(); }},
      {"wait for a plan", [](Bench& bench) { bench.axis().wait(bench.axis().plan(0.001).move); }},
  };
}

motion::PathSegment segmentTo(double number, motion::PathSegment::Shape shape) {
  motion::PathSegment segment;
  segment.shape = shape;
  segment.end = {number, 0.0};
  segment.plane = {"x", "y"};
  segment.point = {number, number};
  segment.control1 = {number, 0.01};
  segment.control2 = {0.01, number};
  return segment;
}

std::vector<Call> callsOfAMachine(double number) {
  using SegmentShape = motion::PathSegment::Shape;
  const std::string text = std::to_string(number);
  std::vector<Call> calls = {
      {"axis " + text, [=](Bench& bench) { bench.machine->axis(text); }},
      {"jog of one " + text,
       [=](Bench& bench) {
         static_cast<void>(bench.machine->jog({{"x", number, {}}}));
       }},
      {"jog of two",
       [](Bench& bench) {
         static_cast<void>(bench.machine->jog({{"x", 0.01, {}}, {"x", 0.01, {}}}));
       }},
      {"followSetpoints " + text,
       [=](Bench& bench) {
         static_cast<void>(bench.machine->followSetpoints(machine::SetpointMode::kPosition, number,
                                                          {{"x", number, {}}}));
       }},
      {"moveLine " + text,
       [=](Bench& bench) {
         bench.machine->moveLine({{"x", "y"}, {number, 0.01}, false, 0.0, 0.0});
       }},
      {"moveLine at " + text,
       [=](Bench& bench) {
         bench.machine->moveLine({{"x"}, {0.01}, false, number, 0.0});
       }},
      {"moveLine in " + text,
       [=](Bench& bench) {
         bench.machine->moveLine({{"x"}, {0.01}, false, 0.0, number});
       }},
      {"moveLine of none", [](Bench& bench) { bench.machine->moveLine({}); }},
      {"moveLine without a position",
       [](Bench& bench) {
         bench.machine->moveLine({{"x"}, {}});
       }},
      {"followTrajectory of none", [](Bench& bench) { bench.machine->followTrajectory({}); }},
      {"followTrajectory to " + text,
       [=](Bench& bench) {
         bench.machine->followTrajectory({{"x"}, {{1.0, {number}, {}, {}}}});
       }},
      {"followTrajectory in " + text,
       [=](Bench& bench) {
         bench.machine->followTrajectory({{"x"}, {{number, {0.01}, {0.0}, {number}}}});
       }},
      {"followTrajectory later by " + text,
       [=](Bench& bench) {
         bench.machine->followTrajectory({{"x"}, {{1.0, {0.01}, {}, {}}}, true, number});
       }},
      {"followPath of none", [](Bench& bench) { bench.machine->followPath({}); }},
      {"appendPath", [](Bench& bench) { bench.machine->appendPath({}); }},
      {"setSpeedOverride " + text, [=](Bench& bench) { bench.machine->setSpeedOverride(number); }},
      {"home all", [](Bench& bench) { bench.machine->home(); }},
      {"home twice",
       [](Bench& bench) {
         bench.machine->home({"x", "x"});
       }},
      {"hold", [](Bench& bench) { bench.machine->hold(); }},
      {"resume", [](Bench& bench) { bench.machine->resume(); }},
      {"recover", [](Bench& bench) { bench.machine->recover(); }},
      {"recording", [](Bench& bench) { bench.machine->recording(); }},
      {"rig " + text, [=](Bench& bench) { bench.rig.report(text); }},
      {"rig's relay", [](Bench& bench) { bench.rig.stickMotorPower(true, 0); }},
      {"trace " + text, [=](Bench& bench) { bench.trace->times(text, text, true); }},
      {"driver chip " + text, [=](Bench& /*bench*/) { driver::driverChip(text); }},
      {"mode path", [](Bench& /*bench*/) { driver::modePath(driver::driverChip("a4988"), 1, 32); }},
      {"step rates",
       [](Bench& bench) { machine::stepRates({bench.axis().config()}, pulse::Capability()); }},
      {"motor limits", [](Bench& /*bench*/) { setup::motorLimits({}, 1); }},
  };
  for (const SegmentShape shape : {SegmentShape::kLine, SegmentShape::kArcAround,
                                   SegmentShape::kArcThrough, SegmentShape::kBezier}) {
    calls.push_back(
        {"followPath " + std::to_string(static_cast<int>(shape)) + " " + text, [=](Bench& bench) {
           motion::PathRequest request;
           request.names = {"x", "y"};
           request.segments = {segmentTo(number, shape)};
           request.tolerance = number;
           bench.machine->followPath(request);
         }});
  }
  return calls;
}

/// What is wrong with the way in which a call is refused; empty: it was accepted, or refused well.
std::string complaintAbout(const Call& call, Bench& bench) {
  std::string what;
  try {
    call.call(bench);
    return "";
  } catch (const Error& error) {
    what = error.what();
  } catch (const std::exception& error) {
    return call.name + " throws something else than an Error: " + error.what();
  }
  const bool says_why = !what.empty() && what.back() != ' ' && what.back() != ':';
  return says_why ? "" : call.name + " is refused without a reason: \"" + what + "\"";
}

/// A machine in a state in which it may refuse.
struct State {
  const char* name;
  std::function<void(Bench&)> enter;
};

const std::vector<State>& states() {
  static const std::vector<State> all = {
      {"at rest", [](Bench&) {}},
      {"in motion", [](Bench& bench) { bench.axis().moveTo(0.05); }},
      {"on hold", [](Bench& bench) { bench.machine->hold(); }},
      {"disabled", [](Bench& bench) { bench.axis().enable(false); }},
      {"asleep", [](Bench& bench) { bench.axis().sleep(true); }},
      {"after an emergency stop", [](Bench& bench) { bench.machine->emergencyStop(); }},
      {"after its end", [](Bench& bench) { bench.machine->shutdown(); }},
  };
  return all;
}

TEST(Refusals, AreErrorsThatSayWhyInEachState) {
  std::vector<config::AxisConfig> axes = {test::homingAxis("x"), test::linearAxis("y")};
  axes[0].min_position = -0.1;
  axes[0].max_position = 0.1;
  axes[1].pins.sleep = axes[1].pins.reset = {};
  int calls = 0;
  for (const State& state : states()) {
    for (const double number : oddNumbers()) {
      std::vector<Call> all = callsOfAnAxis(number);
      for (Call& call : callsOfAMachine(number)) all.push_back(std::move(call));
      Bench bench(axes);
      bench.may_exceed_limits = true;
      for (const Call& call : all) {
        EXPECT_EQ(complaintAbout({"enter", state.enter}, bench), "") << state.name;
        EXPECT_EQ(complaintAbout(call, bench), "") << state.name;
        ++calls;
        if (std::string(state.name) == "after its end") continue;
        bench.machine->stop();
        if (bench.machine->emergencyStopped()) bench.machine->recover();
      }
    }
  }
  EXPECT_GT(calls, 5000);
}

}  // namespace
}  // namespace stepdriver
