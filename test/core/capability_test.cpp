#include "stepdriver_core/machine/capability.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/fake_hardware.h"

namespace stepdriver {
namespace {

using machine::Capability;
using pulse::Nanoseconds;
using pulse::Spread;
using test::LateClock;
using test::linearAxis;
using test::SlowBackend;

/// Counts 1, 2, 3 ... of a step.
auto rising(Nanoseconds step) {
  return [step, next = Nanoseconds{0}]() mutable { return next += step; };
}

TEST(Spread, TakesPercentilesFromTheTimesThemselves) {
  std::vector<Nanoseconds> times;
  for (Nanoseconds i = 200; i > 0; --i) times.push_back(10 * i);
  const Spread spread = pulse::spreadOf(times);
  EXPECT_EQ(spread.count, 200U);
  EXPECT_EQ(spread.p50, 1000);
  EXPECT_EQ(spread.p90, 1800);
  EXPECT_EQ(spread.p99, 1980);
  EXPECT_EQ(spread.max, 2000);
  EXPECT_EQ(pulse::spreadOf({7}).p99, 7);
  EXPECT_EQ(pulse::spreadOf({}).count, 0U);
}

TEST(Capability, TellsTheLatenessOfBothKindsOfWait) {
  LateClock clock;
  clock.spun = rising(10);
  clock.slept = rising(1000);
  clock.spin_guard = 60'000;
  const pulse::WakeUps wake_ups = pulse::measureWakeUps(clock);
  EXPECT_EQ(wake_ups.spun.count, 250U);
  EXPECT_EQ(wake_ups.spun.p50, 1250);
  EXPECT_EQ(wake_ups.spun.p90, 2250);
  EXPECT_EQ(wake_ups.spun.p99, 2480);
  EXPECT_EQ(wake_ups.spun.max, 2500);
  EXPECT_EQ(wake_ups.slept.count, 150U);
  EXPECT_EQ(wake_ups.slept.p99, 149'000);
  EXPECT_EQ(wake_ups.guard, 60'000);
  EXPECT_GE(wake_ups.rights.scheduler, 0) << "it asks as the pulse thread does";
}

TEST(Capability, IsMeasuredInBoundedTimeOnAMachineThatStalls) {
  LateClock clock;
  clock.spun = [] { return 300'000'000; };
  clock.slept = clock.spun;
  const Nanoseconds begin = clock.now();
  const pulse::WakeUps wake_ups = pulse::measureWakeUps(clock);
  EXPECT_EQ(wake_ups.spun.count, 4U);
  EXPECT_EQ(wake_ups.spun.p50, 300'000'000);
  EXPECT_LT(clock.now() - begin, 3'000'000'000);
}

TEST(Capability, TellsWhatTheCallsOfEachAxisCost) {
  LateClock clock;
  SlowBackend backend(clock);
  backend.write_cost = rising(10);
  backend.read_cost = [](const std::string& line) { return line == "x.max" ? 5000 : 4000; };
  axis::AxisConfig plain = linearAxis("y");
  plain.endstop_min.reset();
  plain.endstop_max.reset();
  const Capability capability = machine::measure({linearAxis("x"), plain}, backend, clock);
  ASSERT_EQ(capability.calls.size(), 2U);
  EXPECT_EQ(capability.calls[0].write.count, 200U);
  EXPECT_EQ(capability.calls[0].write.p50, 1010) << "the first of 201 isn't counted";
  EXPECT_EQ(capability.calls[0].write.p99, 1990);
  EXPECT_EQ(capability.calls[0].read.p99, 5000) << "the slower endstop counts";
  EXPECT_EQ(capability.calls[1].write.p50, 3020);
  EXPECT_EQ(capability.calls[1].read.count, 0U);
}

TEST(Capability, IsMeasuredWithoutAnEdge) {
  for (const bool inverted : {false, true}) {
    LateClock clock;
    SlowBackend backend(clock);
    axis::AxisConfig config = linearAxis("x");
    config.pins.step.inverted = inverted;
    machine::measure({config}, backend, clock);
    EXPECT_EQ(backend.writes.size(), 201U);
    for (const SlowBackend::Write& write : backend.writes) {
      EXPECT_FALSE(write.edge);
      EXPECT_EQ(write.line, "x.step");
    }
    EXPECT_FALSE(backend.held);
  }
}

TEST(Capability, NamesTheLineThatFailsWhileItIsMeasured) {
  LateClock clock;
  SlowBackend backend(clock);
  backend.error = EIO;
  try {
    machine::measure({linearAxis("x")}, backend, clock);
    FAIL();
  } catch (const GpioError& error) {
    EXPECT_NE(std::string(error.what()).find("x.step"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("EIO"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(backend.held);
}

}  // namespace
}  // namespace stepdriver
