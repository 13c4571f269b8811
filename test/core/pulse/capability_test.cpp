#include "stepdriver_core/pulse/capability.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <string>
#include <vector>

#include "pulse/measure.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/step_rates.h"
#include "support/bench.h"
#include "support/fake_hardware.h"

namespace stepdriver {
namespace {

using pulse::Capability;
using pulse::Nanoseconds;
using pulse::Spread;
using test::LateClock;
using test::linearAxis;
using test::SlowBackend;

/// Returns step, 2 step, 3 step ...
auto rising(Nanoseconds step) {
  return [step, next = Nanoseconds{0}]() mutable { return next += step; };
}

TEST(Spread, IsThatOfTheSamples) {
  std::vector<Nanoseconds> samples;
  for (Nanoseconds i = 100; i >= 0; --i) samples.push_back(i);
  const Spread spread = pulse::spreadOf(samples);
  EXPECT_EQ(spread.median, 50);
  EXPECT_EQ(spread.p90, 90);
  EXPECT_EQ(spread.p99, 99);
  EXPECT_EQ(spread.max, 100);
  EXPECT_EQ(spread.count, 101U);
  EXPECT_EQ(pulse::spreadOf({7}).median, 7);
}

TEST(Capability, TellsTheLatenessOfBothKindsOfWait) {
  LateClock clock;
  clock.spun = rising(10);
  clock.slept = rising(1000);
  clock.spin_guard = 60'000;
  const Capability capability = pulse::measureWakeUps(clock);
  EXPECT_EQ(capability.lateness.count, 300U);
  EXPECT_EQ(capability.lateness.median, 1510);
  EXPECT_EQ(capability.lateness.p90, 2700);
  EXPECT_EQ(capability.lateness.p99, 2970);
  EXPECT_EQ(capability.lateness.max, 3000);
  EXPECT_EQ(capability.sleep_lateness.count, 100U);
  EXPECT_EQ(capability.sleep_lateness.p99, 99'000);
  EXPECT_EQ(capability.guard, 60'000);
  EXPECT_GE(capability.rights.scheduler_error, 0) << "it asks as the pulse thread does";
  EXPECT_TRUE(capability.channels.empty());
}

TEST(Capability, IsMeasuredInBoundedTimeOnAMachineThatStalls) {
  LateClock clock;
  clock.spun = [] { return 300'000'000; };
  clock.slept = clock.spun;
  const Nanoseconds begin = clock.now();
  const Capability capability = pulse::measureWakeUps(clock);
  EXPECT_EQ(capability.lateness.count, 4U);
  EXPECT_EQ(capability.lateness.median, 300'000'000);
  EXPECT_LT(clock.now() - begin, 3'000'000'000);
}

TEST(Capability, TellsWhatTheCallsOfEachAxisCost) {
  LateClock clock;
  SlowBackend backend(clock);
  backend.write_cost = rising(10);
  backend.read_cost = [](const std::string& line) {
    return line == "x.min" ? 5000 : line == "y.max" ? 7000 : 4000;
  };
  config::AxisConfig plain = linearAxis("z");
  plain.endstop_min.reset();
  plain.endstop_max.reset();
  const Capability capability =
      machine::measure({linearAxis("x"), linearAxis("y"), plain}, backend, clock);
  ASSERT_EQ(capability.channels.size(), 3U);
  EXPECT_EQ(capability.channels[0].write.count, 200U);
  EXPECT_EQ(capability.channels[0].write.median, 1020) << "the first of 201 isn't counted";
  EXPECT_EQ(capability.channels[0].write.p99, 1990);
  EXPECT_EQ(capability.channels[0].read.p99, 5000) << "the slower endstop counts";
  EXPECT_EQ(capability.channels[1].read.p99, 7000);
  EXPECT_EQ(capability.channels[2].write.median, 5040);
  EXPECT_EQ(capability.channels[2].read.count, 0U);
}

TEST(Capability, IsMeasuredWithoutAnEdge) {
  for (const bool inverted : {false, true}) {
    LateClock clock;
    SlowBackend backend(clock);
    config::AxisConfig config = linearAxis("x");
    config.pins.step.inverted = inverted;
    machine::measure({config}, backend, clock);
    EXPECT_EQ(backend.written.size(), 201U);
    for (const SlowBackend::Write& write : backend.written) {
      EXPECT_FALSE(write.edge);
      EXPECT_EQ(write.line, "x.step");
    }
    EXPECT_FALSE(backend.held);
  }
}

TEST(Capability, OfAChipThatTakesItsTimeIsFromFewerCalls) {
  LateClock clock;
  SlowBackend backend(clock);
  backend.write_cost = [] { return 1'000'000; };
  const Capability capability = machine::measure({linearAxis("x")}, backend, clock);
  EXPECT_EQ(capability.channels[0].write.count, 20U);
}

TEST(Capability, NamesTheLineThatFailsWhileItIsMeasured) {
  for (const bool writing : {true, false}) {
    LateClock clock;
    SlowBackend backend(clock);
    (writing ? backend.write_error : backend.read_error) = EIO;
    try {
      machine::measure({linearAxis("x")}, backend, clock);
      FAIL();
    } catch (const GpioError& error) {
      EXPECT_EQ(error.what(), std::string("Line ") + (writing ? "x.step" : "x.min") +
                                  " failed while the cost of its calls was measured: EIO, "
                                  "input/output error.");
    }
    EXPECT_FALSE(backend.held);
  }
}

}  // namespace
}  // namespace stepdriver
