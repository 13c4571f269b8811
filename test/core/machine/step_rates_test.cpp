#include "stepdriver_core/machine/step_rates.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/fake_hardware.h"

namespace stepdriver {
namespace {

using machine::StepRate;
using pulse::Capability;
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
  Nanoseconds slept_median = 0;
};

Capability capabilityOf(const Times& times, std::size_t axes = 1) {
  Capability capability;
  capability.lateness.p99 = times.spun;
  capability.sleep_lateness.p99 = times.slept;
  capability.sleep_lateness.median = times.slept_median;
  capability.guard = times.guard;
  capability.rights = {0, 0};
  pulse::CallCosts cost;
  cost.write.p99 = times.write;
  cost.read.p99 = times.read;
  capability.channels.assign(axes, cost);
  return capability;
}

/// A linear axis of 100,000 steps/m at a speed in steps/s, with high and low times of 1 us.
config::AxisConfig axisOf(double rate, const std::string& name = "x") {
  config::AxisConfig config = linearAxis(name);
  config.steps_per_unit = 100'000.0;
  config.max_speed = rate / config.steps_per_unit;
  return config;
}

StepRate rateOf(const Times& times, double asked = 8000.0) {
  return machine::stepRates({axisOf(asked)}, capabilityOf(times)).axes.front();
}

// At 1/16, a quarter of a full step is four microsteps.
TEST(StepRates, AreLimitedByLatenessAndCallsInAQuarterOfAFullStep) {
  const StepRate rate = rateOf({77'500, 1'000'000, 2000, 500});
  EXPECT_DOUBLE_EQ(rate.held, 4.0e9 / 80'000.0);
  EXPECT_DOUBLE_EQ(rate.alone, rate.held);
  EXPECT_EQ(rate.limited,
            "wake-ups late by 77.5 us and calls of 2.5 us before the pulse is out must fit in the "
            "time of 4 steps");
}

TEST(StepRates, AreLimitedByAQuarterOfAnIntervalIfNoMoreIsAbsorbed) {
  config::AxisConfig full = axisOf(8000.0);
  full.microsteps = 1;
  Capability capability = capabilityOf({77'500, 1'000'000, 2000, 500});
  const StepRate in_full_steps = machine::stepRates({full}, capability).axes.front();
  EXPECT_DOUBLE_EQ(in_full_steps.held, 0.25e9 / 80'000.0);
  EXPECT_NE(in_full_steps.limited.find("in the time of 0.25 steps"), std::string::npos);
  capability.late_steps = 0.0;
  EXPECT_DOUBLE_EQ(machine::stepRates({axisOf(8000.0)}, capability).axes.front().held,
                   0.25e9 / 80'000.0);
  // Longer than what is caught up by the angle.
  const double behind = 2'100'000.0 + 2'500.0;
  EXPECT_DOUBLE_EQ(rateOf({2'100'000, 3'000'000, 2000, 500}).held, 0.25e9 / behind);
}

TEST(StepRatesInMotion, AreThoseOfTheAxesThatMoveBesideTheOthersThatMove) {
  const Times times{197'500, 1'000'000, 2000, 500};
  Capability capability = capabilityOf(times, 3);
  capability.channels[2].write.p99 = 7000;
  const std::vector<config::AxisConfig> axes{axisOf(8000.0), axisOf(8000.0, "y"),
                                             axisOf(8000.0, "z")};
  EXPECT_TRUE(machine::stepRatesInMotion(axes, capability, {0.0, 0.0, 0.0}).axes.empty());
  const auto one = machine::stepRatesInMotion(axes, capability, {3000.0, 0.0, 0.0}).axes;
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(one[0].axis, "x");
  EXPECT_DOUBLE_EQ(one[0].asked, 3000.0);
  EXPECT_DOUBLE_EQ(one[0].held, 4.0e9 / 200'000.0);
  const auto two = machine::stepRatesInMotion(axes, capability, {3000.0, 0.0, 500.0}).axes;
  ASSERT_EQ(two.size(), 2U);
  EXPECT_DOUBLE_EQ(two[0].held, 4.0e9 / (200'000.0 + 7'500.0));
  EXPECT_EQ(two[1].axis, "z");
  EXPECT_DOUBLE_EQ(two[1].asked, 500.0);
}

TEST(StepRates, AreLimitedByThePulseItself) {
  config::AxisConfig config = axisOf(8000.0);
  config.driver.timing.step_high_ns = 30'000;
  config.driver.timing.step_low_ns = 20'000;
  const StepRate rate =
      machine::stepRates({config}, capabilityOf({1000, 1'000'000, 2000, 500})).axes.front();
  EXPECT_DOUBLE_EQ(rate.held, 0.9e9 / (4'500.0 + 50'000.0));
}

TEST(StepRates, AreLimitedByWhatMayBeSpun) {
  const StepRate rate = rateOf({1000, 1'000'000, 1000, 0, 59'000});
  EXPECT_DOUBLE_EQ(rate.held, 1e9 / (60'000.0 / 0.8)) << "the guard, and the high time of 1 us";
  EXPECT_EQ(rate.limited,
            "before an edge the pulse thread spins for 59.0 us, which is allowed for 80 % of the "
            "time; without spinning, wake-ups are later");
}

TEST(StepRates, CountThatALateSleepIsSpunForShorter) {
  Times times{1000, 1'000'000, 1000, 0, 59'000};
  times.slept_median = 8'000;
  EXPECT_DOUBLE_EQ(rateOf(times).held, 1e9 / (52'000.0 / 0.8));
  times.slept_median = 40'000;
  EXPECT_DOUBLE_EQ(rateOf(times).held, 1e9 / 62'000.0) << "no room for a sleep: it only spins";
}

TEST(StepRates, GoOnWithoutSpinningWhereSleepingIsPunctualEnough) {
  const StepRate rate = rateOf({1000, 99'000, 1000, 0, 60'000});
  EXPECT_DOUBLE_EQ(rate.held, 4.0e9 / 100'000.0);
}

TEST(StepRates, LeaveRoomForTheOtherAxes) {
  const std::vector<config::AxisConfig> axes = {axisOf(1000.0), axisOf(2000.0, "y"),
                                                axisOf(3000.0, "z")};
  const auto rates =
      machine::stepRates(axes, capabilityOf({197'500, 1'000'000, 2000, 500}, 3)).axes;
  for (const StepRate& rate : rates) {
    EXPECT_DOUBLE_EQ(rate.alone, 4.0e9 / 200'000.0);
    EXPECT_DOUBLE_EQ(rate.held, 4.0e9 / 205'000.0);
  }
  EXPECT_EQ(rates[1].axis, "y");
  EXPECT_DOUBLE_EQ(rates[1].asked, 2000.0);
  const auto spinning =
      machine::stepRates(axes, capabilityOf({1000, 1'000'000, 1000, 0, 59'000}, 3)).axes;
  const double others = (1.0 - 60e-6 * 2000.0) * (1.0 - 60e-6 * 3000.0);
  EXPECT_DOUBLE_EQ(spinning[0].held, (1.0 - 0.2 / others) / 60e-6);
  EXPECT_NE(spinning[0].limited.find("the other axes take 28 %"), std::string::npos)
      << spinning[0].limited;
}

TEST(StepRates, AreNeverBelowWhatSleepingAloneHolds) {
  const std::vector<config::AxisConfig> axes = {axisOf(1000.0), axisOf(100'000.0, "y")};
  const auto rates =
      machine::stepRates(axes, capabilityOf({1000, 198'000, 1000, 0, 60'000}, 2)).axes;
  EXPECT_DOUBLE_EQ(rates[0].held, 4.0e9 / 200'000.0) << "y takes all that may be spun";
}

TEST(StepRates, ThatDoNotHoldNameAxisAskedRateHeldRateAndReason) {
  const Capability capability = capabilityOf({77'500, 1'000'000, 2000, 500});
  EXPECT_TRUE(machine::stepRates({axisOf(50'000.0)}, capability).holds());
  EXPECT_TRUE(machine::stepRates({axisOf(50'000.0)}, capability).complaints().empty());
  const auto rates = machine::stepRates({axisOf(50'001.0)}, capability);
  EXPECT_FALSE(rates.holds());
  ASSERT_EQ(rates.complaints().size(), 1U);
  EXPECT_EQ(
      rates.complaints()[0],
      "x needs 50001 steps/s (938 rpm), but this computer can sustain 50000 steps/s (937 "
      "rpm): wake-ups late by 77.5 us and calls of 2.5 us before the pulse is out must fit in "
      "the time of 4 steps");
  const std::vector<config::AxisConfig> two = {axisOf(49'000.0), axisOf(1000.0, "y")};
  const auto both =
      machine::stepRates(two, capabilityOf({77'500, 1'000'000, 2000, 500}, 2)).complaints();
  ASSERT_EQ(both.size(), 1U);
  EXPECT_NE(both[0].find("but this computer can sustain 48484 steps/s (909 rpm) while all axes "
                         "move, and 50000 steps/s (937 rpm) while only it does: "),
            std::string::npos)
      << both[0];
}

TEST(WhyNotInRealtime, NamesRightsAndAxes) {
  Capability capability = capabilityOf({77'500, 1'000'000, 2000, 500});
  EXPECT_EQ(machine::whyNotInRealtime({axisOf(50'000.0)}, capability), "");
  const std::string too_fast = machine::whyNotInRealtime({axisOf(50'001.0)}, capability);
  EXPECT_NE(too_fast.find("x needs 50001 steps/s"), std::string::npos) << too_fast;
  EXPECT_NE(too_fast.find("PREEMPT_RT"), std::string::npos) << too_fast;
  for (const pulse::RealtimeRights rights : {pulse::RealtimeRights{EPERM, 0}, {0, EPERM}}) {
    capability.rights = rights;
    const std::string why = machine::whyNotInRealtime({axisOf(50'000.0)}, capability);
    EXPECT_NE(why.find(rights.text()), std::string::npos) << why;
  }
}

/// The rates of a machine on a late clock and slow lines.
class MachineOnSlowHardware : public testing::Test {
 protected:
  MachineOnSlowHardware() {
    setLateness(196'000);
    backend.write_cost = [] { return 2'000; };
    backend.read_cost = [](const std::string&) { return 2'000; };
  }

  void setLateness(Nanoseconds lateness) {
    clock.spun = clock.slept = [lateness] { return lateness; };
  }

  enum class Measure { kNo, kWarn, kEnforce };

  std::unique_ptr<test::UnthreadedMachine> make(double rate, Measure measure) {
    config::AxisConfig config = axisOf(rate);
    config.start_speed = config.max_speed;
    machine::MachineOptions options;
    options.measure = measure != Measure::kNo;
    options.enforce = measure == Measure::kEnforce;
    return std::make_unique<test::UnthreadedMachine>(std::vector<config::AxisConfig>{config},
                                                     backend, clock, options);
  }

  LateClock clock;
  SlowBackend backend{clock};
};

constexpr double kHeld = 20'000.0;  // (196 + 2 + 2) us in the time of 4 steps

TEST_F(MachineOnSlowHardware, KeepsWhatItMeasured) {
  const auto machine = make(kHeld * 2, Measure::kWarn);
  ASSERT_TRUE(machine->capability());
  EXPECT_EQ(machine->capability()->channels[0].write.p99, 2'000);
}

TEST_F(MachineOnSlowHardware, RefusesIfAskedToAndReleasesEveryLineUnmoved) {
  try {
    make(kHeld + 1.0, Measure::kEnforce);
    FAIL();
  } catch (const Refused& refused) {
    const std::string text = refused.what();
    EXPECT_NE(text.find("x needs 20001"), std::string::npos) << text;
  }
  EXPECT_FALSE(backend.held);
  for (const SlowBackend::Write& write : backend.written) EXPECT_FALSE(write.edge) << write.line;
}

TEST_F(MachineOnSlowHardware, MeasuresNothingUnasked) {
  clock.is_realtime = false;
  EXPECT_FALSE(make(kHeld * 2, Measure::kEnforce)->capability());
  clock.is_realtime = true;
  EXPECT_FALSE(make(kHeld * 2, Measure::kNo)->capability());
}

// The formula describes the real engine: up to this rate its timeline doesn't slide, above it does.
class FormulaOnTheEngine : public MachineOnSlowHardware {
 protected:
  /// @return the slips during moves of 1000 steps and more of all axes at once, each at its top
  /// speed. The first step of each motion may slip.
  std::uint64_t slips(std::vector<config::AxisConfig> configs) {
    for (config::AxisConfig& config : configs) config.start_speed = config.max_speed;
    test::UnthreadedMachine machine(configs, backend, clock);
    std::vector<axis::Move> moves;
    for (const auto& axis : machine.axes()) {
      moves.push_back(axis->moveTo(0.01 * axis->config().max_speed / configs[0].max_speed));
    }
    for (std::size_t i = 0; i < moves.size(); ++i) {
      EXPECT_EQ(machine.axes()[i]->wait(moves[i]).end, axis::MoveEnd::kReached);
    }
    return machine.figures().slips;
  }

  double held(const std::vector<config::AxisConfig>& configs) {
    return machine::stepRates(configs, machine::measure(configs, backend, clock)).axes[0].held;
  }
};

TEST_F(FormulaOnTheEngine, HoldsWhereLatenessLimits) {
  EXPECT_DOUBLE_EQ(held({axisOf(1000.0)}), kHeld);
  EXPECT_LE(slips({axisOf(kHeld)}), 1U);
  EXPECT_GT(slips({axisOf(kHeld * 1.06)}), 100U);
}

TEST_F(FormulaOnTheEngine, HoldsWhereThePulseLimits) {
  setLateness(1'000);
  const auto slow = [](double rate) {
    config::AxisConfig config = axisOf(rate);
    config.driver.timing.step_high_ns = 30'000;
    config.driver.timing.step_low_ns = 20'000;
    return config;
  };
  const double rate = held({slow(1000.0)});
  EXPECT_DOUBLE_EQ(rate, 0.9e9 / 56'000.0);
  EXPECT_LE(slips({slow(rate)}), 1U);
  EXPECT_GT(slips({slow(rate * 1.15)}), 900U);
}

TEST_F(FormulaOnTheEngine, HoldsForAxesThatMoveAtOnce) {
  setLateness(1'000);
  const double rate = held({axisOf(1000.0), axisOf(1000.0, "y")});
  EXPECT_DOUBLE_EQ(rate, 0.9e9 / 16'000.0);
  for (const double ratio : {1.0, 0.97, 0.9, 0.77, 0.5, 0.31}) {
    EXPECT_LE(slips({axisOf(rate), axisOf(rate * ratio, "y")}), 2U) << "ratio " << ratio;
  }
  EXPECT_GT(slips({axisOf(rate * 2.0), axisOf(rate * 1.9, "y")}), 100U);
}

// From the lateness of a real-time kernel to that of a busy computer. Steps of one instant share a
// write, which the formula doesn't count on. Steps are at whole nanoseconds, so the rate itself may
// slip by one.
TEST_F(FormulaOnTheEngine, HoldsForAllLatenessesAxesAndMicrosteps) {
  for (const Nanoseconds lateness : {10'000, 60'000, 300'000, 1'000'000}) {
    for (const std::size_t count : {1U, 2U, 6U}) {
      for (const int microsteps : {1, 2, 4, 16, 32}) {
        setLateness(lateness);
        const auto at = [&](double rate) {
          std::vector<config::AxisConfig> axes;
          for (std::size_t i = 0; i < count; ++i) {
            axes.push_back(axisOf(rate, std::string(1, static_cast<char>('u' + i))));
            axes.back().driver = driver::driverChip("drv8825");
            axes.back().microsteps = microsteps;
          }
          return axes;
        };
        const double rate = held(at(1000.0));
        EXPECT_LE(slips(at(rate * 0.9999)), count)
            << lateness << " ns, " << count << " axes, 1/" << microsteps << ", " << rate;
      }
    }
  }
}

}  // namespace
}  // namespace stepdriver
