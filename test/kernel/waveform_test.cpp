#include "waveform.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <sstream>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"

// Tests the checker of waveforms with traces that are written by hand.

namespace stepdriver::kernel {
namespace {

constexpr unsigned kStep = 497;
constexpr unsigned kDir = 498;
constexpr unsigned kEnable = 499;

using Broken = std::map<Rule, std::size_t>;

/// A trace that is made event by event. Times are nanoseconds after a second.
class Hand {
 public:
  Hand& at(std::int64_t time_ns, unsigned line, bool level, const char* what = "set") {
    char event[128];
    std::snprintf(event, sizeof(event), "  pulse-37 [000] ..... 1.%09lld: gpio_value: %u %s %d\n",
                  static_cast<long long>(time_ns), line, what, level ? 1 : 0);
    text_ += event;
    return *this;
  }

  /// DIR low (backward), STEP low, ENABLE low (on), long before anything else.
  Hand& request(bool step = false, bool dir = false, bool enable = false) {
    return at(0, kDir, dir).at(0, kStep, step).at(0, kEnable, enable);
  }

  Hand& pulse(std::int64_t begin, std::int64_t end) {
    return at(begin, kStep, true).at(end, kStep, false);
  }

  Waveform read(const WiredAxis& axis) const {
    std::istringstream stream(text_);
    return waveformOf(KernelTrace(stream), axis);
  }

 private:
  std::string text_;
};

/// A DRV8825: 1.9 us high and low, DIR 650 ns before and after, 650 ns after ENABLE; 600 ns from
/// one write to the next.
WiredAxis wired() {
  WiredAxis axis;
  axis.driver = driver::driverChip("drv8825");
  axis.step.line = kStep;
  axis.dir.line = kDir;
  axis.enable = WiredPin{kEnable, false};
  axis.one_write_ns = 600;
  return axis;
}

Broken brokenIn(const Hand& hand, const WiredAxis& axis = wired()) {
  return hand.read(axis).violationsByRule();
}

TEST(Waveform, CountsPulsesByTheLevelOfDirAtTheActiveEdge) {
  const Waveform seen = Hand()
                            .request()
                            .pulse(10'000, 12'000)
                            .at(14'000, kDir, true)
                            .pulse(20'000, 22'000)
                            .at(30'000, kStep, true)
                            .at(31'000, kDir, false)
                            .at(32'000, kStep, false)
                            .read(wired());
  ASSERT_EQ(seen.pulses.size(), 3U);
  EXPECT_EQ(seen.pulses[0].time_ns, 1'000'010'000);
  EXPECT_FALSE(seen.pulses[0].forward);
  EXPECT_TRUE(seen.pulses[1].forward);
  EXPECT_TRUE(seen.pulses[2].forward);
  EXPECT_EQ(seen.forward(), 2);
  EXPECT_EQ(seen.backward(), 1);
  EXPECT_EQ(seen.position(), 1);
  EXPECT_EQ(seen.edges, 8U);
  EXPECT_EQ(seen.violationsByRule(), Broken{});
}

TEST(Waveform, TakesRewrittenLevelsAndReadsForNoEdges) {
  const Waveform seen = Hand()
                            .request()
                            .at(9'000, kStep, false)
                            .at(9'900, kDir, false)
                            .at(9'900, kEnable, false)
                            .pulse(10'000, 12'000)
                            .at(12'100, kDir, false)
                            .at(12'200, kStep, true, "get")
                            .at(12'300, kStep, false)
                            .read(wired());
  EXPECT_EQ(seen.edges, 2U);
  EXPECT_EQ(seen.position(), -1);
  EXPECT_EQ(seen.violationsByRule(), Broken{});
}

TEST(Waveform, SeesThroughTheInversionOfEachPin) {
  WiredAxis axis = wired();
  axis.step.inverted = axis.dir.inverted = axis.enable->inverted = true;
  const Waveform seen = Hand()
                            .request(true, true, true)
                            .at(10'000, kStep, false)
                            .at(12'000, kStep, true)
                            .at(13'000, kDir, false)
                            .at(14'100, kStep, false)
                            .at(16'000, kStep, true)
                            .read(axis);
  EXPECT_EQ(seen.forward(), 1);
  EXPECT_EQ(seen.backward(), 1);
  EXPECT_EQ(seen.violationsByRule(), Broken{});
  EXPECT_NE(brokenIn(Hand().request().pulse(10'000, 12'000), axis), Broken{});
}

TEST(Waveform, FindsThatAPulseIsTooShort) {
  EXPECT_EQ(brokenIn(Hand().request().pulse(10'000, 11'900)), Broken{});
  const auto violations = Hand().request().pulse(10'000, 11'899).read(wired()).violations;
  ASSERT_EQ(violations.size(), 1U);
  EXPECT_EQ(violations[0].rule, Rule::kStepHigh);
  EXPECT_EQ(violations[0].time_ns, 1'000'011'899);
  EXPECT_EQ(violations[0].seen_ns, 1'899);
  EXPECT_EQ(violations[0].least_ns, 1'900);
}

TEST(Waveform, FindsThatAGapIsTooShort) {
  const auto gap = [](std::int64_t time) {
    return brokenIn(Hand().request().pulse(10'000, 12'000).pulse(12'000 + time, 20'000));
  };
  EXPECT_EQ(gap(2'100), Broken{});
  EXPECT_EQ(gap(2'099), (Broken{{Rule::kStepLow, 1}}));
}

TEST(Waveform, FindsThatDirChangedTooCloseBeforeAStep) {
  const auto setup = [](std::int64_t time) {
    return brokenIn(Hand().request().at(10'000, kDir, true).pulse(10'000 + time, 20'000));
  };
  EXPECT_EQ(setup(650), Broken{});
  EXPECT_EQ(setup(649), (Broken{{Rule::kDirSetup, 1}}));
}

TEST(Waveform, FindsAStepBeforeDirIsDriven) {
  EXPECT_EQ(brokenIn(Hand()
                         .at(0, kStep, false)
                         .at(0, kEnable, false)
                         .pulse(10'000, 12'000)
                         .at(20'000, kDir, true)),
            (Broken{{Rule::kDirSetup, 1}}));
  EXPECT_EQ(brokenIn(Hand()
                         .at(0, kStep, false)
                         .at(0, kEnable, false)
                         .at(9'900, kDir, true)
                         .pulse(10'000, 12'000)),
            (Broken{{Rule::kDirSetup, 1}}));
}

TEST(Waveform, FindsThatDirChangedTooCloseAfterAStep) {
  const auto hold = [](std::int64_t time) {
    return brokenIn(Hand()
                        .request()
                        .at(10'000, kStep, true)
                        .at(10'000 + time, kDir, true)
                        .at(12'000, kStep, 0));
  };
  EXPECT_EQ(hold(650), Broken{});
  EXPECT_EQ(hold(649), (Broken{{Rule::kDirHold, 1}}));
}

TEST(Waveform, FindsThatStepAndDirChangeInOneWrite) {
  WiredAxis axis = wired();
  axis.driver.timing.dir_setup_ns = axis.driver.timing.dir_hold_ns = 0;
  const auto apart = [&axis](std::int64_t time) {
    return brokenIn(Hand().request().at(10'000, kDir, true).pulse(10'000 + time, 20'000), axis);
  };
  EXPECT_EQ(apart(0), (Broken{{Rule::kOneWrite, 1}}));
  EXPECT_EQ(apart(600), (Broken{{Rule::kOneWrite, 1}}));
  EXPECT_EQ(apart(601), Broken{});
  EXPECT_EQ(
      brokenIn(
          Hand().request().at(10'000, kStep, true).at(10'256, kDir, true).at(20'000, kStep, false),
          axis),
      (Broken{{Rule::kOneWrite, 1}}));
}

TEST(Waveform, FindsStepsWhileNotEnabled) {
  EXPECT_EQ(brokenIn(Hand().request(false, false, true).pulse(10'000, 12'000)),
            (Broken{{Rule::kEnabled, 1}}));
  EXPECT_EQ(brokenIn(Hand()
                         .request()
                         .pulse(10'000, 12'000)
                         .at(20'000, kEnable, true)
                         .pulse(30'000, 32'000)
                         .pulse(40'000, 42'000)
                         .at(50'000, kEnable, false)
                         .pulse(60'000, 62'000)),
            (Broken{{Rule::kEnabled, 2}}));
  EXPECT_EQ(brokenIn(Hand()
                         .at(0, kStep, false)
                         .at(0, kDir, true)
                         .pulse(10'000, 12'000)
                         .at(20'000, kEnable, false)),
            (Broken{{Rule::kEnabled, 1}}))
      << "ENABLE isn't driven yet";
  WiredAxis axis = wired();
  axis.enable.reset();
  EXPECT_EQ(brokenIn(Hand().request(false, false, true).pulse(10'000, 12'000), axis), Broken{});
}

TEST(Waveform, FindsAStepTooSoonAfterEnable) {
  const auto enabled = [](std::int64_t time) {
    return brokenIn(
        Hand().request(false, false, true).at(10'000, kEnable, false).pulse(10'000 + time, 20'000));
  };
  EXPECT_EQ(enabled(650), Broken{});
  EXPECT_EQ(enabled(649), (Broken{{Rule::kEnableTime, 1}}));
}

TEST(Waveform, FindsStepsCloserThanPlanned) {
  WiredAxis axis = wired();
  axis.shortest_interval_ns = 10'000;
  const auto interval = [&axis](std::int64_t time) {
    return brokenIn(Hand().request().pulse(10'000, 12'000).pulse(10'000 + time, 30'000), axis);
  };
  EXPECT_EQ(interval(10'000), Broken{});
  EXPECT_EQ(interval(9'999), (Broken{{Rule::kInterval, 1}}));
}

TEST(Waveform, FindsThatStepRestsActive) {
  EXPECT_EQ(brokenIn(Hand().request(true)), (Broken{{Rule::kRest, 2}})) << "from begin to end";
  EXPECT_EQ(brokenIn(Hand().request(true).at(10'000, kStep, false)), (Broken{{Rule::kRest, 1}}));
  EXPECT_EQ(brokenIn(Hand().request().at(10'000, kStep, true)), (Broken{{Rule::kRest, 1}}));
}

TEST(Waveform, KnowsTheShortestTimes) {
  const ShortestTimes shortest = Hand()
                                     .request()
                                     .pulse(10'000, 15'000)
                                     .pulse(20'000, 23'000)
                                     .at(24'000, kDir, true)
                                     .pulse(31'000, 35'000)
                                     .read(wired())
                                     .shortest;
  EXPECT_EQ(shortest.high, 3'000);
  EXPECT_EQ(shortest.low, 5'000);
  EXPECT_EQ(shortest.interval, 10'000);
  EXPECT_EQ(shortest.dir_setup, 7'000);
  EXPECT_EQ(shortest.dir_hold, 4'000);
  EXPECT_EQ(Hand().request().read(wired()).shortest.high, std::nullopt);
}

TEST(Waveform, RefusesALineThatNothingHappenedTo) {
  WiredAxis step = wired();
  step.step.line = 1;
  EXPECT_THROW(Hand().request().read(step), Error);
  WiredAxis dir = wired();
  dir.dir.line = 1;
  EXPECT_THROW(Hand().request().read(dir), Error);
  WiredAxis enable = wired();
  enable.enable->line = 1;
  EXPECT_THROW(Hand().request().read(enable), Error);
}

TEST(Waveform, IsReportedWithTheFirstPlaceOfEachViolation) {
  EXPECT_EQ(reportOf(Hand()
                         .request()
                         .pulse(10'000, 11'500)
                         .pulse(20'000, 21'000)
                         .at(30'000, kEnable, true)
                         .pulse(40'000, 42'000)
                         .read(wired())),
            "  edges read from the kernel: 7\n"
            "  pulses: 0 forward, 3 backward; position -3\n"
            "  shortest: STEP high 1.000 us, low 8.500 us, interval 10.000 us; "
            "DIR setup 10.000 us, hold -\n"
            "  violations: 3\n"
            "    2 x STEP high time, first at 1.000011500 s: 1.500 us, and at least 1.900 us is "
            "right\n"
            "    1 x STEP while not enabled, first at 1.000040000 s\n");
}

}  // namespace
}  // namespace stepdriver::kernel
