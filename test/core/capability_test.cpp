#include "stepdriver_core/pulse/capability.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/machine/step_rates.h"
#include "support/bench.h"

namespace stepdriver {
namespace {

using machine::StepRates;
using pulse::Capability;
using pulse::Nanoseconds;

/// Time that goes on by what is done: a wake-up is late by a pattern, a call takes what it costs.
class FakeClock : public pulse::Clock {
 public:
  Nanoseconds now() override { return now_; }
  void waitUntil(Nanoseconds time) override {
    // One of a hundred is 40 us late, one of nine 20 us, all others 5 us.
    ++waits_;
    now_ = std::max(now_, time) + (waits_ % 100 == 0 ? 40'000 : waits_ % 9 == 0 ? 20'000 : 5'000);
  }
  void wake() override {}
  bool realtime() const override { return true; }
  void spend(Nanoseconds time) { now_ += time; }

 private:
  Nanoseconds now_ = 0;
  int waits_ = 0;
};

/// Lines that take time and remember what they were written.
class SlowLines : public gpio::Lines {
 public:
  explicit SlowLines(FakeClock& clock) : clock_(clock) {}

  int write(const gpio::LineWrite* writes, std::size_t count) noexcept override {
    clock_.spend(2'000);
    for (std::size_t i = 0; i < count; ++i) written.push_back(writes[i]);
    return error;
  }
  int read(int input) noexcept override {
    clock_.spend(1'500);
    read_inputs.push_back(input);
    return read_error != 0 ? -read_error : 1;
  }
  int waitForEdges(std::int64_t /*timeout_ns*/, gpio::EdgeEvent* /*events*/,
                   std::size_t /*capacity*/) noexcept override {
    return 0;
  }
  void interrupt() noexcept override {}
  const std::string& outputName(int /*output*/) const override { return name_; }
  const std::string& inputName(int /*input*/) const override { return name_; }

  std::vector<gpio::LineWrite> written;
  std::vector<int> read_inputs;
  int error = 0;
  int read_error = 0;

 private:
  FakeClock& clock_;
  const std::string name_ = "a line";
};

std::vector<pulse::ChannelConfig> channels() {
  std::vector<pulse::ChannelConfig> channels(2);
  channels[0].step = {3, true};
  channels[0].endstop_min = pulse::Signal{7, true};
  channels[1].step = {5, false};
  return channels;
}

TEST(Spread, IsThatOfTheSamples) {
  std::vector<Nanoseconds> samples;
  for (Nanoseconds i = 100; i >= 0; --i) samples.push_back(i);
  const pulse::Spread spread = pulse::spreadOf(samples);
  EXPECT_EQ(spread.median, 50);
  EXPECT_EQ(spread.p90, 90);
  EXPECT_EQ(spread.p99, 99);
  EXPECT_EQ(spread.max, 100);
  EXPECT_EQ(pulse::spreadOf({7}).median, 7);
}

TEST(MeasureCapability, TellsWhatCallsCostAndHowLateWakeUpsAre) {
  FakeClock clock;
  SlowLines lines(clock);
  const Capability capability = pulse::measureCapability(lines, clock, channels());
  ASSERT_EQ(capability.channels.size(), 2U);
  EXPECT_EQ(capability.channels[0].write.median, 2'000);
  EXPECT_EQ(capability.channels[0].read.median, 1'500);
  EXPECT_EQ(capability.channels[1].write.max, 2'000);
  EXPECT_EQ(capability.channels[1].read.max, 0);
  EXPECT_EQ(capability.lateness.median, 5'000);
  EXPECT_EQ(capability.lateness.p90, 20'000);
  EXPECT_EQ(capability.lateness.max, 40'000);
}

TEST(MeasureCapability, WritesStepLinesTheLevelThatTheyHaveAndNothingElse) {
  FakeClock clock;
  SlowLines lines(clock);
  pulse::measureCapability(lines, clock, channels());
  ASSERT_FALSE(lines.written.empty());
  for (const gpio::LineWrite& write : lines.written) {
    EXPECT_TRUE(write.output == 3 || write.output == 5);
    EXPECT_EQ(write.level, write.output == 5) << "at rest";
  }
  for (const int input : lines.read_inputs) EXPECT_EQ(input, 7);
}

TEST(MeasureCapability, SaysWhereALineFails) {
  FakeClock clock;
  SlowLines lines(clock);
  lines.error = ENODEV;
  EXPECT_THROW(pulse::measureCapability(lines, clock, channels()), GpioError);
  lines.error = 0;
  lines.read_error = EIO;
  EXPECT_THROW(pulse::measureCapability(lines, clock, channels()), GpioError);
}

/// An axis of 1 us high and low that asks for a rate [steps/s].
axis::AxisConfig asking(double rate) {
  axis::AxisConfig config = test::linearAxis("x");
  config.steps_per_unit = 1000.0;
  config.max_speed = rate / 1000.0;
  return config;
}

Capability capability(Nanoseconds write, Nanoseconds read, Nanoseconds late) {
  Capability capability;
  pulse::CallCosts costs;
  costs.write.median = write;
  costs.read.median = read;
  capability.channels = {costs};
  capability.lateness.p99 = late;
  capability.rights = {0, 0};
  return capability;
}

TEST(StepRates, AreLimitedByTheCallsWhereWakeUpsAreOnTime) {
  const StepRates rates = machine::stepRates({asking(100'000)}, capability(2'000, 1'500, 500));
  // 1.5 us + 2 x 2 us + 1 us + 1 us + 0.5 us
  EXPECT_NEAR(rates.axes[0].held, 1e9 / 8'000, 1e-6);
  EXPECT_TRUE(rates.holds());
  EXPECT_NEAR(rates.load, 0.55, 1e-12);
  EXPECT_TRUE(rates.complaints().empty());
}

TEST(StepRates, AreLimitedByLateWakeUps) {
  const StepRates rates = machine::stepRates({asking(12'501)}, capability(500, 0, 20'000));
  EXPECT_NEAR(rates.axes[0].held, 12'500, 1e-6) << "a quarter of 80 us";
  EXPECT_FALSE(rates.holds());
  ASSERT_EQ(rates.complaints().size(), 1U);
  EXPECT_EQ(rates.complaints()[0],
            "x: asks for 12501 steps/s, and this machine holds 12500 steps/s: wake-ups are up to "
            "20.0 us late (p99), and a quarter of an interval can be made good");
}

TEST(StepRates, AreLimitedByAllAxesTogether) {
  Capability both = capability(2'000, 0, 0);
  both.channels.push_back(both.channels[0]);
  EXPECT_TRUE(machine::stepRates({asking(118'000), asking(118'000)}, both).holds());
  const StepRates rates = machine::stepRates({asking(120'000), asking(120'000)}, both);
  EXPECT_NEAR(rates.load, 0.96, 1e-12);
  EXPECT_FALSE(rates.holds());
  ASSERT_EQ(rates.complaints().size(), 1U);
  EXPECT_NE(rates.complaints()[0].find("96 %"), std::string::npos) << rates.complaints()[0];
}

class MachineOnASlowComputer : public testing::Test {
 protected:
  // Simulated lines, each of whose calls takes its time.
  class SlowBackend : public gpio::Backend {
   public:
    explicit SlowBackend(FakeClock& clock) : clock_(clock) {}
    std::unique_ptr<gpio::Lines> request(
        const std::vector<gpio::OutputRequest>& /*outputs*/,
        const std::vector<gpio::InputRequest>& /*inputs*/) override {
      ++requests;
      return std::make_unique<SlowLines>(clock_);
    }
    int requests = 0;

   private:
    FakeClock& clock_;
  };

  machine::MachineOptions options(bool enforce) {
    machine::MachineOptions options;
    options.threaded = false;
    options.measure = true;
    options.enforce = enforce;
    return options;
  }

  FakeClock clock;
  SlowBackend backend{clock};
};

TEST_F(MachineOnASlowComputer, DoesNotStartWhereThatIsEnforced) {
  axis::AxisConfig config = asking(400'000);
  config.enable_on_start = false;
  try {
    machine::Machine machine({config}, backend, clock, options(true));
    FAIL() << "it started";
  } catch (const Refused& refused) {
    EXPECT_NE(std::string(refused.what()).find("x: asks for 400000 steps/s"), std::string::npos)
        << refused.what();
  }
  EXPECT_EQ(backend.requests, 1);
}

TEST_F(MachineOnASlowComputer, StartsAndTellsWhereThatIsNotEnforced) {
  axis::AxisConfig config = asking(400'000);
  config.enable_on_start = false;
  const machine::Machine machine({config}, backend, clock, options(false));
  ASSERT_TRUE(machine.capability());
  EXPECT_FALSE(machine::stepRates({config}, *machine.capability()).holds());
}

TEST(MachineOnAVirtualClock, HasNothingToMeasure) {
  test::Bench bench({test::linearAxis("x")});
  EXPECT_FALSE(bench.machine->capability());
}

}  // namespace
}  // namespace stepdriver
