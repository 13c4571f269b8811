#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Endstops.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <future>
#include <optional>
#include <string>
#include <thread>

#include "core/support/other_program.h"
#include "hardware/board_and_expander.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

// Arrays as messages contain them.
constexpr std::size_t kX = 0;
constexpr std::size_t kZ = 2;

class TwoChips : public BoardAndExpander {
 protected:
  static StepAndDir stepAndDir(const test::GpioSimChip& chip, const HardwareNode::Axis& axis) {
    return {numberOf(chip.lines(), axis.step), numberOf(chip.lines(), axis.dir)};
  }

  std_srvs::Trigger::Response trigger(const std::string& service) const {
    return node->call<std_srvs::Trigger>(service);
  }

  std::future<MoveTo::Response> moving(const std::string& axis, double position) const {
    return std::async(std::launch::async,
                      [this, axis, position] { return node->move(axis, position, true); });
  }

  /// Waits until this axis is well on its way.
  static void awaitMotion(const Recorder<AxisStates>& states, std::size_t axis) {
    ASSERT_TRUE(states.waitForLatest([axis](const AxisStates& s) {
      return s.moving.at(axis) != 0 && s.position.at(axis) > 0.001;
    })) << "it doesn't move";
  }

  /// Sends SIGTERM.
  /// @return the exit code; no value if the node is still running.
  std::optional<int> end() const {
    node->process().signal(SIGTERM);
    return node->process().waitForExit(kBound);
  }

  static void expectSafe(const kernel::KernelTrace& trace, const test::GpioSimChip& chip,
                         const HardwareNode::Axis& axis) {
    const auto last = [&](unsigned offset) {
      return lastSet(trace, numberOf(chip.lines(), offset));
    };
    EXPECT_FALSE(last(axis.step));
    EXPECT_TRUE(last(axis.enable)) << "high: disabled";
    EXPECT_FALSE(last(axis.sleep)) << "low: asleep";
    EXPECT_FALSE(last(axis.reset)) << "low: held";
  }
};

TEST_F(TwoChips, MoveAtTheSameTimeAndEndSafelyOnSigtermInMidMove) {
  node->start();
  const Recorder<AxisStates> states(node->full("axis_states"));
  auto x = moving("x", 1.0);
  awaitMotion(states, kX);
  auto y = moving("y", 0.0095);
  auto z = moving("z", -0.005);
  EXPECT_TRUE(y.get().success);
  EXPECT_TRUE(z.get().success);
  const auto code = end();
  const auto stopped = x.get();
  EXPECT_FALSE(stopped.success);
  expectSays(stopped.message, "shut down");
  EXPECT_EQ(code.value_or(-1), 0) << node->process().output();

  const auto trace = record->read();
  const StepAndDir x_lines = stepAndDir(*board, HardwareNode::kX);
  const StepAndDir y_lines = stepAndDir(*board, HardwareNode::kY);
  EXPECT_EQ(pulsesIn(trace, x_lines), HardwareNode::stepsOf(stopped.position));
  EXPECT_EQ(pulsesIn(trace, y_lines), HardwareNode::stepsOf(0.0095));
  EXPECT_EQ(pulsesIn(trace, stepAndDir(*expander, HardwareNode::kZ)),
            HardwareNode::stepsOf(-0.005));
  expectSafe(trace, *board, HardwareNode::kX);
  expectSafe(trace, *board, HardwareNode::kY);
  expectSafe(trace, *expander, HardwareNode::kZ);
  if (gpio::libgpiodVersion()[0] != '1') return;
  EXPECT_EQ(changesTogether(trace, x_lines.step, x_lines.dir), 0);
  EXPECT_EQ(changesTogether(trace, y_lines.step, y_lines.dir), 0);
  EXPECT_GT(changesTogether(trace, x_lines.step, y_lines.step), 0) << "of two axes on one chip";
}

TEST_F(TwoChips, HaveANodeWithLockedMemoryThatTakesLittle) {
  node->start();
  EXPECT_TRUE(node->move("x", 0.002, true).success);
  EXPECT_GT(node->process().kilobytes("VmLck"), 5'000U);
  EXPECT_LT(node->process().kilobytes("VmRSS"), 40'000U);
}

TEST_F(TwoChips, StopAnAxisWhoseDriverReportsAFaultAndResetItToRecover) {
  node->start();
  const Recorder<AxisStates> states(node->full("axis_states"));
  auto x = moving("x", 0.01);
  auto z = moving("z", 0.2);
  awaitMotion(states, kZ);
  expander->drive(HardwareNode::kZFault, false);
  const auto stopped = z.get();
  EXPECT_FALSE(stopped.success);
  expectSays(stopped.message, "nFAULT");
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) {
    return s.fault.at(kZ).find("nFAULT") != std::string::npos && s.fault.at(kX).empty();
  }));
  EXPECT_TRUE(x.get().success) << "the others go on";
  expectSays(node->move("z", 0.0, true).message, "recover");
  EXPECT_EQ(pulsesIn(record->read(), stepAndDir(*expander, HardwareNode::kZ)),
            HardwareNode::stepsOf(stopped.position));

  const auto still = trigger("recover");
  EXPECT_FALSE(still.success);
  expectSays(still.message, "still reports a fault");

  // The chip releases the line when it is reset.
  std::atomic<bool> ended{false};
  std::thread chip([&] {
    while (!ended) {
      if (!expander->level(HardwareNode::kZ.reset)) expander->drive(HardwareNode::kZFault, true);
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  });
  const auto recovered = trigger("recover");
  ended = true;
  chip.join();
  EXPECT_TRUE(recovered.success) << recovered.message;
  const auto on = node->move("z", stopped.position + 0.001, true);
  EXPECT_TRUE(on.success) << on.message;
}

TEST_F(TwoChips, LoseOneInMidMoveAndGoOnWithTheOther) {
  node->start();
  const Recorder<AxisStates> states(node->full("axis_states"));
  const Recorder<Endstops> endstops(node->full("endstops"));
  auto x = moving("x", 0.02);
  auto y = moving("y", 0.2);
  auto z = moving("z", 0.2);
  awaitMotion(states, kZ);
  const std::string name = expander->name();
  expander->unplug();
  const auto lost = z.get();
  EXPECT_FALSE(lost.success);
  expectSays(lost.message, " line expander:");
  expectSays(lost.message, " (" + name + ":");
  expectSays(lost.message, "ENODEV, no such device: the chip was removed; plug it in");
  const auto blind = y.get();
  EXPECT_FALSE(blind.success);
  expectSays(blind.message, "the max endstop's line expander:13 (" + name +
                                ":13, chip \"expander\") can't be read: ENODEV");
  EXPECT_TRUE(states.waitForLatest([&](const AxisStates& s) {
    return s.fault.at(kZ).find("expander:") != std::string::npos && s.position_valid.at(kZ) == 0 &&
           s.fault.at(kX).empty();
  }));
  const auto reached = x.get();
  EXPECT_TRUE(reached.success) << reached.message;

  const auto back = node->move("x", 0.015, true);
  EXPECT_TRUE(back.success) << back.message;
  EXPECT_EQ(pulsesIn(record->read(), stepAndDir(*board, HardwareNode::kX)),
            HardwareNode::stepsOf(0.015));
  board->drive(HardwareNode::kX.max, true);
  EXPECT_TRUE(endstops.waitForLatest([](const Endstops& e) { return e.max.at(kX) != 0; }))
      << "the switches of the other chip are still published";
  const auto recover = trigger("recover");
  EXPECT_FALSE(recover.success);
  expectSays(recover.message, "expander:");
  expectSays(recover.message, "ENODEV");

  EXPECT_FALSE(node->move("y", 0.2, true).success) << "not a step without its switch";
  EXPECT_EQ(pulsesIn(record->read(), stepAndDir(*board, HardwareNode::kY)),
            HardwareNode::stepsOf(blind.position));

  const auto code = end();
  EXPECT_EQ(code.value_or(-1), 2) << node->process().output();
  expectSays(node->process().output(), "Not all could be disabled: z: ");
  const auto trace = record->read();
  expectSafe(trace, *board, HardwareNode::kX);
  expectSafe(trace, *board, HardwareNode::kY);
}

TEST_F(TwoChips, AreNotTouchedWhereALineIsHeldByAnotherProgram) {
  const test::OtherProgram other(expander->name(), HardwareNode::kZ.enable, "gpiomon");
  node->launch();
  EXPECT_EQ(node->process().waitForExit(kBound).value_or(-1), 2);
  const std::string output = node->process().output();
  expectSays(output,
             "Line expander:2 (" + expander->name() +
                 ":2, chip \"expander\") is busy (EBUSY, device or resource busy): it is held by "
                 "\"gpiomon\". Stop that program or driver, or name another line.");
  const auto trace = record->read();
  EXPECT_TRUE(std::all_of(trace.events().begin(), trace.events().end(), [](const auto& event) {
    return event.read;
  })) << "a line was touched";
}

}  // namespace
}  // namespace stepdriver::node_test
