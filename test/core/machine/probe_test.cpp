#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/passing_lines.h"
#include "support/probe_bench.h"
#include "support/refusal.h"

// Probing on the rig: 80 steps/mm; the probe of x is pressed from 20 mm on.

namespace stepdriver {
namespace {

using machine::ProbeEnd;
using machine::ProbeRequest;
using machine::ProbeResult;
using test::Bench;
using test::kStep;
using test::linearAxis;

/// The line of the probe can be made unreadable.
class BreakableLines : public test::PassingLines {
 public:
  using PassingLines::PassingLines;
  int read(int input) noexcept override {
    return broken && inputName(input) == "io.probe" ? -EIO : PassingLines::read(input);
  }
  bool broken = false;
};

class BreakableBackend : public gpio::Backend {
 public:
  explicit BreakableBackend(gpio::Backend& backend) : backend_(backend) {}
  std::unique_ptr<gpio::Lines> request(const std::vector<gpio::OutputRequest>& outputs,
                                       const std::vector<gpio::InputRequest>& inputs) override {
    auto breakable = std::make_unique<BreakableLines>(backend_.request(outputs, inputs));
    lines = breakable.get();
    return breakable;
  }
  BreakableLines* lines = nullptr;

 private:
  gpio::Backend& backend_;
};

class ProbeTest : public testing::Test {
 protected:
  struct Rig {
    double contact = 20.0;  // [mm]
    double hysteresis = 0.0;
    int bounces = 0;
    std::int64_t debounce_ns = 0;
    bool must_home = false;
  };

  void SetUp() override { build({}); }

  void build(const Rig& rig) {
    std::vector<config::AxisConfig> axes{linearAxis("x"), linearAxis("y")};
    if (rig.must_home) {
      axes[0].homing.emplace().kind = config::HomingKind::kDirect;
      axes[0].require_homing = true;
    }
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
    specs[0].flags.push_back(
        test::probeSwitch(rig.contact, rig.contact + 60.0, rig.hysteresis, rig.bounces));
    bench = std::make_unique<Bench>(axes, specs, false, 0.0, test::probeOptions(rig.debounce_ns));
    if (rig.must_home) return;
    for (const auto& axis : bench->machine->axes()) axis->setPosition(0.0);
  }

  static ProbeRequest towards(double x) {
    ProbeRequest request;
    request.input = "probe";
    request.names = {"x"};
    request.positions = {x};
    request.velocity = 0.02;
    return request;
  }
  static ProbeRequest inTwoTouches(double x) {
    ProbeRequest request = towards(x);
    request.second_velocity = 0.002;
    request.back_off = 0.003;
    return request;
  }

  ProbeResult probe(const ProbeRequest& request, const std::function<bool()>& cancelled = {}) {
    return bench->machine->probe(request, cancelled);
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(ProbeTest, ComesToRestAfterTheContactAndKnowsItsPlace) {
  const ProbeResult result = probe(towards(0.05));
  EXPECT_EQ(result.end, ProbeEnd::kContact) << result.message;
  EXPECT_TRUE(result.succeeded);
  EXPECT_NEAR(result.contact.at(0), 0.02 - 0.5 * kStep, 1e-8);
  EXPECT_GT(result.positions.at(0), 0.02);
  // 0.02 m/s at 1 m/s^2 are 0.2 mm.
  EXPECT_LT(result.positions.at(0), 0.0204);
  EXPECT_FALSE(bench->axis().state().moving);
}

TEST_F(ProbeTest, TouchesASecondTimeAndGoesBackToTheContact) {
  ProbeRequest request = inTwoTouches(0.05);
  request.returns = true;
  const ProbeResult result = probe(request);
  EXPECT_EQ(result.end, ProbeEnd::kContact) << result.message;
  EXPECT_NEAR(result.contact.at(0), 0.02 - 0.5 * kStep, 1e-8);
  EXPECT_NEAR(bench->axis().state().position, result.contact.at(0), 0.51 * kStep);
}

TEST_F(ProbeTest, WhoseSwitchOpensTooLateForTheSecondTouchSaysSo) {
  build({20.0, 2.0});
  ProbeRequest request = towards(0.05);
  request.second_velocity = 0.002;
  request.back_off = 0.001;
  const ProbeResult result = probe(request);
  EXPECT_EQ(result.end, ProbeEnd::kFailed);
  EXPECT_EQ(result.message, "x: the input probe is active already, so it can't tell of a contact");
  EXPECT_NEAR(result.contact.at(0), 0.02 - 0.5 * kStep, 1e-8) << "that of the first touch";
  EXPECT_FALSE(bench->axis().state().moving);
}

TEST_F(ProbeTest, OnTheWrongSideMeetsNoContact) {
  build({-70.0});  // from -70 to -10 mm
  const ProbeResult result = probe(towards(0.05));
  EXPECT_EQ(result.end, ProbeEnd::kNoContact);
  EXPECT_EQ(result.message,
            "the first touch met no contact at the input probe: all axes reached their targets");
}

// It takes a moment until the pulses stop: never beyond the position of the request.
TEST_F(ProbeTest, AContactRightBeforeTheEndMovesNoFarther) {
  for (const double place : {49.9, 49.99, 49.9875, 50.0}) {
    build({place});
    ProbeRequest request = towards(0.05);
    request.velocity = 0.1;
    const ProbeResult result = probe(request);
    EXPECT_EQ(result.end, ProbeEnd::kContact) << place << ": " << result.message;
    EXPECT_LE(bench->pulses(), 4000) << place;
  }
}

TEST_F(ProbeTest, AlongALineOfSeveralAxesTellsAllOfThem) {
  ProbeRequest request = towards(0.04);
  request.names = {"x", "y"};
  request.positions = {0.04, -0.02};
  const ProbeResult result = probe(request);
  ASSERT_EQ(result.contact.size(), 2U) << result.message;
  EXPECT_NEAR(result.contact[1], -0.5 * result.contact[0], 0.51 * kStep);
  EXPECT_NEAR(result.positions[1], -0.5 * result.positions[0], 1.01 * kStep);
}

TEST_F(ProbeTest, AwayFromAContactTakesTheEdgeAtWhichItEnds) {
  build({-40.0});  // pressed until 20 mm
  ProbeRequest request = towards(0.05);
  request.away = true;
  const ProbeResult result = probe(request);
  EXPECT_EQ(result.end, ProbeEnd::kContact) << result.message;
  EXPECT_NEAR(result.contact.at(0), 0.02 + 0.5 * kStep, 1e-8);
}

TEST_F(ProbeTest, WithoutAContactItFailsOrNotAsAsked) {
  ProbeRequest request = towards(0.01);
  ProbeResult result = probe(request);
  EXPECT_EQ(result.end, ProbeEnd::kNoContact);
  EXPECT_FALSE(result.succeeded);
  EXPECT_NEAR(result.positions.at(0), 0.01, 1e-9);
  EXPECT_TRUE(result.contact.empty());
  request.positions = {0.0};
  request.must = false;
  result = probe(request);
  EXPECT_EQ(result.end, ProbeEnd::kNoContact);
  EXPECT_TRUE(result.succeeded);
}

TEST_F(ProbeTest, IsRefusedIfTheContactIsThereAtTheStart) {
  build({-1.0});
  EXPECT_REFUSED(probe(towards(0.05)), "the input probe is active already");
  ProbeRequest request = towards(0.05);
  request.second_velocity = 0.001;
  EXPECT_REFUSED(probe(request), "back_off above 0");
  EXPECT_EQ(bench->pulses(), 0);
}

TEST_F(ProbeTest, EndsWithWhateverEndsALine) {
  const std::vector<std::function<void()>> ends{
      [this] { bench->axis().stop(); }, [this] { bench->axis().enable(false); },
      [this] { bench->machine->emergencyStop(); }, [this] { bench->axis().moveTo(-0.01); }};
  for (const auto& end : ends) {
    build({});
    bool done = false;
    const ProbeResult result = probe(towards(0.05), [&] {
      if (!done && bench->axis().state().position > 0.005) {
        done = true;
        end();
      }
      return false;
    });
    EXPECT_TRUE(done);
    EXPECT_EQ(result.end, ProbeEnd::kFailed) << result.message;
    EXPECT_FALSE(result.succeeded);
  }
  // The move that took over isn't stopped by a contact.
  bench->machine->advance(1.0);
  EXPECT_NEAR(bench->axis().state().position, -0.01, 1e-9);
}

TEST_F(ProbeTest, AHoldOnlyPutsOffTheContact) {
  bool held = false;
  const ProbeResult result = probe(towards(0.05), [&] {
    if (!held && bench->axis().state().position > 0.005) {
      held = true;
      bench->machine->hold();
      bench->machine->advance(0.5);
      bench->machine->resume();
    }
    return false;
  });
  EXPECT_TRUE(held);
  EXPECT_EQ(result.end, ProbeEnd::kContact) << result.message;
  EXPECT_NEAR(result.contact.at(0), 0.02 - 0.5 * kStep, 1e-8);
}

// The hold comes while the axis decelerates from the contact, and ends when it has come to rest.
TEST_F(ProbeTest, AHoldBetweenTwoTouchesOnlyPutsOffTheSecond) {
  bool held = false;
  bool resumed = false;
  const ProbeResult result = probe(inTwoTouches(0.05), [&] {
    if (!held && bench->axis().state().position > 0.02) {
      held = true;
      bench->machine->hold();
    }
    if (held && !resumed && !bench->axis().state().moving) {
      resumed = true;
      bench->machine->advance(0.5);
      bench->machine->resume();
    }
    return false;
  });
  EXPECT_TRUE(resumed);
  EXPECT_EQ(result.end, ProbeEnd::kContact) << result.message;
  EXPECT_NEAR(result.contact.at(0), 0.02 - 0.5 * kStep, 1e-8);
}

TEST_F(ProbeTest, DeceleratesWhenItIsCancelled) {
  const ProbeResult result =
      probe(towards(0.05), [&] { return bench->axis().state().position > 0.005; });
  EXPECT_EQ(result.end, ProbeEnd::kCancelled);
  EXPECT_LT(result.positions.at(0), 0.006);
}

// The contact is known then, but the axis doesn't stand there.
TEST_F(ProbeTest, IsCancelledOnTheWayBack) {
  ProbeRequest request = towards(0.05);
  request.velocity = 0.1;
  request.returns = true;
  const ProbeResult result = probe(request, [&] { return bench->axis().state().velocity < 0.0; });
  EXPECT_EQ(result.end, ProbeEnd::kCancelled) << result.message;
  EXPECT_FALSE(result.succeeded);
  EXPECT_NEAR(result.contact.at(0), 0.02 - 0.5 * kStep, 1e-8);
  EXPECT_GT(result.positions.at(0), 0.021);
}

// Whoever stops the axis must find it at rest, and not see it leave for the next stroke.
TEST_F(ProbeTest, AStopWhileItComesToRestEndsItWithoutAnotherStroke) {
  bool done = false;
  const ProbeResult result = probe(inTwoTouches(0.05), [&] {
    if (!done && bench->axis().state().position > 0.02) {
      done = true;
      bench->axis().stop();
    }
    return false;
  });
  EXPECT_TRUE(done);
  EXPECT_EQ(result.end, ProbeEnd::kFailed);
  EXPECT_EQ(result.message, "x: it was stopped");
  EXPECT_GT(bench->axis().state().position, 0.02);
}

TEST_F(ProbeTest, WorksBeforeTheAxisIsHomedIfItsWayIsRelative) {
  build({20.0, 0.0, 0, 0, true});
  ProbeRequest request = towards(0.05);
  EXPECT_REFUSED(probe(request), "home");
  request.relative = true;
  request.second_velocity = 0.002;
  request.back_off = 0.003;
  request.returns = true;
  const ProbeResult result = probe(request);
  EXPECT_EQ(result.end, ProbeEnd::kContact) << result.message;
  EXPECT_NEAR(result.contact.at(0), 0.02 - 0.5 * kStep, 1e-8);
}

TEST_F(ProbeTest, IsRefusedIfAnAxisMovesOrTheNumbersAreWrong) {
  ProbeRequest request = towards(0.05);
  request.second_velocity = std::nan("");
  EXPECT_REFUSED(probe(request), "the second_velocity of the probing is nan");
  request.second_velocity = 0.0;
  request.back_off = -1.0;
  EXPECT_REFUSED(probe(request), "the back_off of the probing is -1");
  request.positions.push_back(0.0);
  request.back_off = 0.0;
  EXPECT_REFUSED(probe(request), "there are 1 names, but 2 positions");
  EXPECT_EQ(bench->pulses(), 0);
  bench->axis().moveTo(0.01);
  EXPECT_REFUSED(probe(towards(0.05)), "it moves; a probing begins at rest");
}

// A round has 3200 steps, and the probe is pressed from 30 to 60 degrees.
TEST(ProbeOfARotaryAxis, FindsTheAngleInEitherDirectionAndBeyondARound) {
  constexpr double kRound = 2.0 * test::kPi;
  constexpr double kAngle = kRound / 3200.0;
  config::AxisConfig config = linearAxis("x", 1.0 / kAngle, 3.0, 30.0);
  config.kind = config::Kind::kRotary;
  config.continuous = true;
  config.endstop_min.reset();
  config.endstop_max.reset();
  std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
  specs[0].full_step_travel = 360.0 / 200.0;
  sim::SwitchSpec contact;
  contact.line = "io.probe";
  contact.active_level = true;
  contact.position = 30.0;
  contact.end = 60.0;
  contact.every = 360.0;
  specs[0].flags.push_back(contact);
  machine::MachineOptions options;
  options.inputs.emplace_back();
  options.inputs[0].name = "probe";
  options.inputs[0].line = {"io.probe", true, Bias::kAsIs};
  Bench bench({config}, specs, false, 0.0, options);
  bench.axis().setPosition(0.0);
  const auto expect_contact = [&](double to, double velocity, double place) {
    ProbeRequest request;
    request.input = "probe";
    request.names = {"x"};
    request.positions = {to};
    request.velocity = velocity;
    request.second_velocity = 0.1;
    request.back_off = 0.2;
    const ProbeResult result = bench.machine->probe(request);
    EXPECT_EQ(result.end, ProbeEnd::kContact) << result.message;
    ASSERT_EQ(result.contact.size(), 1U);
    // The first step at or beyond the edge presses it, half a step before it is there.
    const double step =
        to > 0.0 ? std::ceil(place / kAngle - 1e-6) - 0.5 : std::floor(place / kAngle + 1e-6) + 0.5;
    EXPECT_NEAR(result.contact[0] / kAngle, step, 1e-5) << place;
  };
  expect_contact(kRound, 1.0, kRound / 12.0);
  bench.move(2.5 * kRound);
  expect_contact(10.0 * kRound, 3.0, (3.0 + 1.0 / 12.0) * kRound);
  bench.move(-0.5 * kRound);
  expect_contact(-10.0 * kRound, 2.0, (-1.0 + 1.0 / 6.0) * kRound);
}

TEST(UnreadableProbe, MovesNothingAndEndsAMotion) {
  const std::vector<config::AxisConfig> axes{linearAxis("x")};
  machine::MachineOptions options;
  config::InputConfig input;
  input.name = "probe";
  input.line = {"io.probe", true, Bias::kAsIs};
  options.inputs.push_back(input);
  sim::Rig rig(Bench::rigAxes(axes), nullptr, {}, {}, Bench::ioOf(options));
  pulse::VirtualClock clock;
  gpio::SimulatedBackend simulated(rig, [&clock] { return clock.now(); });
  BreakableBackend backend(simulated);
  test::UnthreadedMachine machine(axes, backend, clock, options);
  machine.axis("x").setPosition(0.0);
  ProbeRequest request;
  request.input = "probe";
  request.names = {"x"};
  request.positions = {0.05};
  request.velocity = 0.02;
  const ProbeResult result = machine.probe(request, [&] {
    backend.lines->broken = machine.axis("x").state().position > 0.005;
    return false;
  });
  EXPECT_EQ(result.end, ProbeEnd::kFailed);
  EXPECT_NE(result.message.find("the input probe can't be read: EIO, input/output error"),
            std::string::npos)
      << result.message;
  EXPECT_LT(result.positions.at(0), 0.01);
  EXPECT_REFUSED(machine.probe(request),
                 "the line io.probe of the input probe can't be read: EIO, input/output error");
}

}  // namespace
}  // namespace stepdriver
