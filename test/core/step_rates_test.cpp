#include <gtest/gtest.h>

#include <cerrno>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/capability.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/fake_hardware.h"

namespace stepdriver {
namespace {

using machine::Capability;
using machine::RealtimePolicy;
using machine::StepRate;
using pulse::Nanoseconds;
using test::LateClock;
using test::linearAxis;
using test::SlowBackend;

/// Times of an axis without endstops, in nanoseconds.
struct Times {
  Nanoseconds spun = 0;
  Nanoseconds slept = 1'000'000;
  Nanoseconds write = 0;
  Nanoseconds read = 0;
  Nanoseconds guard = 0;
  Nanoseconds slept_p50 = 0;
};

Capability capabilityOf(const Times& times, std::size_t axes = 1) {
  Capability capability;
  capability.wake_ups.spun.p99 = times.spun;
  capability.wake_ups.slept.p99 = times.slept;
  capability.wake_ups.slept.p50 = times.slept_p50;
  capability.wake_ups.guard = times.guard;
  pulse::CallCost cost;
  cost.write.p99 = times.write;
  cost.read.p99 = times.read;
  capability.calls.assign(axes, cost);
  return capability;
}

/// A linear axis of 100,000 steps/m at a speed in steps/s, with high and low times of 1 us.
axis::AxisConfig axisOf(double rate, const std::string& name = "x") {
  axis::AxisConfig config = linearAxis(name);
  config.steps_per_unit = 100'000.0;
  config.max_speed = rate / config.steps_per_unit;
  return config;
}

StepRate rateOf(const Times& times, double asked = 8000.0) {
  return machine::stepRates({axisOf(asked)}, capabilityOf(times)).front();
}

TEST(StepRates, AreLimitedByLatenessAndCallsInAQuarterOfAnInterval) {
  const StepRate rate = rateOf({10'000, 1'000'000, 2000, 500});
  EXPECT_DOUBLE_EQ(rate.held, 1e9 / (4.0 * 12'500.0));
  EXPECT_DOUBLE_EQ(rate.alone, rate.held);
  EXPECT_EQ(rate.limit, machine::RateLimit::kLateness);
  EXPECT_EQ(rate.reason,
            "wake-ups late by 10.0 us and calls of 2.5 us before the pulse is out must fit in a "
            "quarter of a step's interval");
}

TEST(StepRates, AreLimitedByThePulseItself) {
  axis::AxisConfig config = axisOf(8000.0);
  config.timing.step_high_ns = 30'000;
  config.timing.step_low_ns = 20'000;
  const StepRate rate =
      machine::stepRates({config}, capabilityOf({1000, 1'000'000, 2000, 500})).front();
  EXPECT_DOUBLE_EQ(rate.held, 1e9 / (2'000.0 + 4'500.0 + 50'000.0));
  EXPECT_EQ(rate.limit, machine::RateLimit::kPulse);
}

TEST(StepRates, AreLimitedByWhatMayBeSpun) {
  const StepRate rate = rateOf({1000, 1'000'000, 1000, 0, 59'000});
  EXPECT_DOUBLE_EQ(rate.held, 1e9 / (60'000.0 / 0.8)) << "the guard, and the high time of 1 us";
  EXPECT_EQ(rate.limit, machine::RateLimit::kSpinning);
  EXPECT_EQ(rate.reason,
            "before an edge the pulse thread spins for 59.0 us, which it may for 80 % of the time, "
            "and without spinning wake-ups are later");
}

TEST(StepRates, CountThatALateSleepIsSpunForShorter) {
  Times times{1000, 1'000'000, 1000, 0, 59'000};
  times.slept_p50 = 8'000;
  EXPECT_DOUBLE_EQ(rateOf(times).held, 1e9 / (52'000.0 / 0.8));
  times.slept_p50 = 40'000;
  EXPECT_DOUBLE_EQ(rateOf(times).held, 1e9 / 62'000.0) << "no room for a sleep: it only spins";
}

TEST(StepRates, GoOnWithoutSpinningWhereSleepingIsPunctualEnough) {
  const StepRate rate = rateOf({1000, 9000, 1000, 0, 60'000});
  EXPECT_DOUBLE_EQ(rate.held, 1e9 / (4.0 * 10'000.0));
  EXPECT_EQ(rate.limit, machine::RateLimit::kLateness);
}

TEST(StepRates, LeaveRoomForTheOtherAxes) {
  const std::vector<axis::AxisConfig> axes = {axisOf(1000.0), axisOf(2000.0, "y"),
                                              axisOf(3000.0, "z")};
  const auto rates = machine::stepRates(axes, capabilityOf({10'000, 1'000'000, 2000, 500}, 3));
  for (const StepRate& rate : rates) {
    EXPECT_DOUBLE_EQ(rate.alone, 1e9 / (4.0 * 12'500.0));
    EXPECT_DOUBLE_EQ(rate.held, 1e9 / (4.0 * 17'500.0));
  }
  EXPECT_EQ(rates[1].axis, "y");
  EXPECT_DOUBLE_EQ(rates[1].asked, 2000.0);
  const auto spinning =
      machine::stepRates(axes, capabilityOf({1000, 1'000'000, 1000, 0, 59'000}, 3));
  const double others = (1.0 - 60e-6 * 2000.0) * (1.0 - 60e-6 * 3000.0);
  EXPECT_DOUBLE_EQ(spinning[0].held, (1.0 - 0.2 / others) / 60e-6);
  EXPECT_NE(spinning[0].reason.find("the other axes take 28 %"), std::string::npos)
      << spinning[0].reason;
}

TEST(StepRates, AreNeverBelowWhatSleepingAloneHolds) {
  const std::vector<axis::AxisConfig> axes = {axisOf(1000.0), axisOf(100'000.0, "y")};
  const auto rates = machine::stepRates(axes, capabilityOf({1000, 20'000, 1000, 0, 60'000}, 2));
  EXPECT_DOUBLE_EQ(rates[0].held, 1e9 / (4.0 * 22'000.0)) << "y takes all that may be spun";
}

TEST(Shortfalls, NameAxisAskedRateHeldRateAndReason) {
  EXPECT_TRUE(machine::shortfalls({rateOf({10'000, 1'000'000, 2000, 500}, 20'000.0)}).empty());
  const auto texts = machine::shortfalls({rateOf({10'000, 1'000'000, 2000, 500}, 20'001.0)});
  ASSERT_EQ(texts.size(), 1U);
  EXPECT_EQ(texts[0],
            "axis x asks for 20001 steps/s at its top speed, and this machine holds 20000: "
            "wake-ups late by 10.0 us and calls of 2.5 us before the pulse is out must fit in a "
            "quarter of a step's interval");
  const std::vector<axis::AxisConfig> two = {axisOf(19'000.0), axisOf(1000.0, "y")};
  const auto both =
      machine::shortfalls(machine::stepRates(two, capabilityOf({10'000, 1'000'000, 2000, 500}, 2)));
  ASSERT_EQ(both.size(), 1U);
  EXPECT_NE(both[0].find("holds 16667 while all axes move (20000 alone)"), std::string::npos)
      << both[0];
}

TEST(EnforcementRefusal, NamesWhatIsMissing) {
  pulse::RealtimeRights rights{0, EPERM};
  EXPECT_EQ(machine::enforcementRefusal(rights, {}), "") << "locked memory isn't asked for";
  rights.scheduler = EPERM;
  EXPECT_NE(machine::enforcementRefusal(rights, {}).find("SCHED_FIFO refused"), std::string::npos);
  rights.scheduler = 0;
  EXPECT_NE(machine::enforcementRefusal(rights, {"axis x asks"}).find("axis x asks"),
            std::string::npos);
}

/// What a machine does on a clock that is late and on lines that are slow.
class MachineOnSlowHardware : public testing::Test {
 protected:
  MachineOnSlowHardware() {
    clock.spun = [] { return 1'000; };
    clock.slept = [] { return 50'000; };
    backend.write_cost = [] { return 2'000; };
    backend.read_cost = [](const std::string&) { return 2'000; };
  }

  std::unique_ptr<machine::Machine> make(double rate, RealtimePolicy policy) {
    axis::AxisConfig config = axisOf(rate);
    config.start_speed = config.max_speed;
    machine::MachineOptions options;
    options.threaded = false;
    options.realtime = policy;
    return std::make_unique<machine::Machine>(std::vector<axis::AxisConfig>{config}, backend, clock,
                                              options);
  }

  LateClock clock;
  SlowBackend backend{clock};
};

constexpr double kHeld = 50'000.0;  // 4 (1 + 2 + 2) us

TEST_F(MachineOnSlowHardware, WarnsOfATopSpeedThatIsBeyondIt) {
  EXPECT_TRUE(make(kHeld, RealtimePolicy::kWarn)->warnings().empty());
  const auto machine = make(kHeld + 1.0, RealtimePolicy::kWarn);
  ASSERT_EQ(machine->warnings().size(), 1U);
  EXPECT_NE(machine->warnings()[0].find("axis x asks for 50001"), std::string::npos);
}

TEST_F(MachineOnSlowHardware, RefusesIfAskedToAndReleasesEveryLineUnmoved) {
  try {
    make(kHeld + 1.0, RealtimePolicy::kEnforce);
    FAIL();
  } catch (const Error& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("axis x asks for 50001"), std::string::npos) << text;
    EXPECT_NE(text.find("PREEMPT_RT"), std::string::npos) << text;
  }
  EXPECT_FALSE(backend.held);
  for (const SlowBackend::Write& write : backend.writes) EXPECT_FALSE(write.edge) << write.line;
}

TEST_F(MachineOnSlowHardware, MeasuresNothingUnasked) {
  clock.is_realtime = false;
  EXPECT_TRUE(make(kHeld * 2, RealtimePolicy::kEnforce)->warnings().empty());
  clock.is_realtime = true;
  EXPECT_TRUE(make(kHeld * 2, RealtimePolicy::kUnmeasured)->warnings().empty());
}

// The formula is about the real engine: up to that rate its timeline stays, and above it slides.
class FormulaOnTheEngine : public MachineOnSlowHardware {
 protected:
  /// @return the slips of moves of 1000 steps and more of all axes at once, each at its top speed.
  std::uint64_t slips(std::vector<axis::AxisConfig> configs) {
    for (axis::AxisConfig& config : configs) config.start_speed = config.max_speed;
    machine::Machine machine(configs, backend, clock, {false});
    std::vector<axis::Move> moves;
    for (const auto& axis : machine.axes()) {
      moves.push_back(axis->moveTo(0.01 * axis->config().max_speed / configs[0].max_speed));
    }
    for (std::size_t i = 0; i < moves.size(); ++i) {
      EXPECT_EQ(machine.axes()[i]->wait(moves[i]).end, axis::MoveEnd::kReached);
    }
    return machine.figures().slips;
  }

  double held(const std::vector<axis::AxisConfig>& configs) {
    return machine::stepRates(configs, machine::measure(configs, backend, clock)).front().held;
  }
};

TEST_F(FormulaOnTheEngine, HoldsWhereLatenessLimits) {
  EXPECT_DOUBLE_EQ(held({axisOf(1000.0)}), kHeld);
  EXPECT_EQ(slips({axisOf(kHeld)}), 0U);
  EXPECT_GT(slips({axisOf(kHeld * 1.01)}), 900U);
}

TEST_F(FormulaOnTheEngine, HoldsWhereThePulseLimits) {
  const auto slow = [](double rate) {
    axis::AxisConfig config = axisOf(rate);
    config.timing.step_high_ns = 30'000;
    config.timing.step_low_ns = 20'000;
    return config;
  };
  const double rate = held({slow(1000.0)});
  EXPECT_DOUBLE_EQ(rate, 1e9 / 58'000.0);
  EXPECT_EQ(slips({slow(rate)}), 0U);
  EXPECT_GT(slips({slow(rate * 1.01)}), 900U);
}

TEST_F(FormulaOnTheEngine, HoldsForAxesThatMoveAtOnce) {
  const double rate = held({axisOf(1000.0), axisOf(1000.0, "y")});
  EXPECT_DOUBLE_EQ(rate, 1e9 / 36'000.0);
  for (const double ratio : {1.0, 0.97, 0.9, 0.77, 0.5, 0.31}) {
    EXPECT_EQ(slips({axisOf(rate), axisOf(rate * ratio, "y")}), 0U) << "ratio " << ratio;
  }
  EXPECT_GT(slips({axisOf(rate * 2.0), axisOf(rate * 1.9, "y")}), 100U);
}

}  // namespace
}  // namespace stepdriver
