#include "kernel_trace.h"

#include <gtest/gtest.h>

#include <sstream>
#include <string>

#include "stepdriver_core/error.h"
#include "stepdriver_core/sim/pin_trace.h"

namespace {

using stepdriver::kernel::KernelTrace;

const std::string kMove =
    "# chip rig 496 16\n"
    "# chip board 2 488 8\n"
    "# tracer: nop\n"
    "#           TASK-PID     CPU#  |||||  TIMESTAMP  FUNCTION\n"
    "         gpioset-37      [000] .....     1.000000100: gpio_value: 497 set 0\n"
    "         gpioset-37      [000] .....     1.000000200: gpio_direction: 497 out (0)\n"
    "         gpioset-37      [000] .....     1.000000300: gpio_value: 498 set 1\n"
    "        a b: c-12        [000] .n...     1.000002000: gpio_value: 497 set 1\n"
    "        a b: c-12        [000] .n...     1.000002300: gpio_value: 498 set 1\n"
    "        a b: c-12        [000] .n...     1.000004500: gpio_value: 490 get 1\n"
    "        a b: c-12        [000] .n...     1.000007000: gpio_value: 497 set 0\n"
    "        a b: c-12        [000] .n...    12.000000000: gpio_value: 498 set 0\n";

KernelTrace traceOf(const std::string& text) {
  std::istringstream stream(text);
  return KernelTrace(stream);
}

std::string refusalOf(const std::string& text) {
  try {
    traceOf(text);
  } catch (const stepdriver::Error& error) {
    return error.what();
  }
  return "";
}

TEST(KernelTrace, ReadsEveryGpioValueWithItsTimeLineAndLevel) {
  const KernelTrace trace = traceOf(kMove);
  ASSERT_EQ(trace.events().size(), 7u);
  EXPECT_EQ(trace.events()[0].time_ns, 1'000'000'100);
  EXPECT_EQ(trace.events()[0].line, 497u);
  EXPECT_FALSE(trace.events()[0].level);
  EXPECT_FALSE(trace.events()[0].read);
  EXPECT_EQ(trace.events()[4].line, 490u);
  EXPECT_TRUE(trace.events()[4].read);
  EXPECT_EQ(trace.events()[6].time_ns, 12'000'000'000);
}

TEST(KernelTrace, TakesTheLevelOfTheRequestForTheFirstLevelNotForAnEdge) {
  const KernelTrace trace = traceOf(kMove);
  EXPECT_EQ(trace.firstLevel(497), false);
  EXPECT_EQ(trace.firstLevel(498), true);
  EXPECT_EQ(trace.firstLevel(499), std::nullopt);
  EXPECT_EQ(trace.times(497, true), std::vector<std::int64_t>{1'000'002'000});
  EXPECT_EQ(trace.times(497, false), std::vector<std::int64_t>{1'000'007'000});
}

TEST(KernelTrace, WritingTheSameLevelAgainIsNoEdge) {
  const auto edges = traceOf(kMove).edges(498);
  ASSERT_EQ(edges.size(), 1u);
  EXPECT_EQ(edges[0].time_ns, 12'000'000'000);
  EXPECT_FALSE(edges[0].level);
}

TEST(KernelTrace, ReadsTheKernelsOwnMicroseconds) {
  const KernelTrace trace =
      traceOf("  gpioset-37  [000] .....     1.717256: gpio_value: 497 set 1\n");
  EXPECT_EQ(trace.events().at(0).time_ns, 1'717'256'000);
}

TEST(KernelTrace, FindsALineByTheLabelOfItsChip) {
  const KernelTrace trace = traceOf(kMove);
  EXPECT_EQ(trace.line("rig:2"), 498u);
  EXPECT_EQ(trace.line("board 2:7"), 495u);
  EXPECT_EQ(trace.line("12"), 12u);
  EXPECT_THROW(trace.line("rig:16"), stepdriver::Error);
  EXPECT_THROW(trace.line("other:1"), stepdriver::Error);
  EXPECT_THROW(trace.line("rig"), stepdriver::Error);
  EXPECT_THROW(trace.line("rig:"), stepdriver::Error);
}

TEST(KernelTrace, RefusesATraceWithDroppedEvents) {
  EXPECT_EQ(refusalOf(kMove + "CPU:0 [LOST 12 EVENTS]\n"),
            "the trace, line 13: the kernel dropped events here: CPU:0 [LOST 12 EVENTS]");
}

TEST(KernelTrace, RefusesTimesThatGoBack) {
  EXPECT_NE(refusalOf(kMove + "  a-1  [000] .....     1.000000: gpio_value: 497 set 1\n"), "");
}

TEST(KernelTrace, RefusesAnEventThatItDoesNotUnderstand) {
  for (const std::string event :
       {"1.000000: gpio_value: 497 put 1", "1.000000: gpio_value: 497 set 2",
        "1.000000: gpio_value: x set 1", "1000000: gpio_value: 497 set 1",
        "1.00: gpio_value: 497 set 1", "1.000000: gpio_value: 497 set"})
    EXPECT_NE(refusalOf("  a-1  [000] .....     " + event + "\n"), "") << event;
}

TEST(KernelTrace, HandsItsEdgesToAPinTrace) {
  stepdriver::sim::MemoryTrace pins;
  copyTo(pins, traceOf(kMove), {{{"x", "dir"}, 498}, {{"x", "step"}, 497}});
  EXPECT_EQ(pins.levels(), (std::vector<bool>{true, false}));
  EXPECT_EQ(pins.times("x", "step", true), std::vector<std::int64_t>{1'000'002'000});
  EXPECT_EQ(pins.times("x", "step", false), std::vector<std::int64_t>{1'000'007'000});
  EXPECT_EQ(pins.times("x", "dir", false), std::vector<std::int64_t>{12'000'000'000});
}

TEST(KernelTrace, DoesNotShowALineThatNothingHappenedTo) {
  stepdriver::sim::MemoryTrace pins;
  EXPECT_THROW(copyTo(pins, traceOf(kMove), {{{"x", "step"}, 499}}), stepdriver::Error);
}

}  // namespace
