#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/passing_lines.h"

// A GPIO chip whose writes hang. Each axis has its own chip.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::linearAxis;
using test::violationsOf;

constexpr std::chrono::seconds kLongestWait{60};

/// Writes of a line wait until the test releases them.
class Gate {
 public:
  void close(const std::string& line) {
    const std::lock_guard<std::mutex> lock(mutex_);
    line_ = line;
    closed_ = true;
    levels_.clear();
  }
  void open() {
    const std::lock_guard<std::mutex> lock(mutex_);
    closed_ = false;
    opened_.notify_all();
  }
  void pass(const std::string& line) {
    if (!closed_) return;
    std::unique_lock<std::mutex> lock(mutex_);
    if (line != line_) return;
    ++waiting_;
    opened_.wait(lock, [this] { return !closed_.load(); });
  }
  int waited() const { return waiting_; }
  void noteWritten(const std::string& line, bool level) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (line == line_) levels_.push_back(level);
  }
  /// What the line was set to since it was closed.
  std::vector<bool> levels() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return levels_;
  }

 private:
  std::string line_;
  std::atomic<bool> closed_{false};
  std::atomic<int> waiting_{0};
  std::vector<bool> levels_;
  mutable std::mutex mutex_;
  std::condition_variable opened_;
};

class GatedLines : public test::PassingLines {
 public:
  GatedLines(std::unique_ptr<gpio::Lines> lines, Gate& gate)
      : PassingLines(std::move(lines)), gate_(gate) {}

  int write(const gpio::LineWrite* writes, std::size_t count) noexcept override {
    for (std::size_t i = 0; i < count; ++i) gate_.pass(outputName(writes[i].output));
    const int error = PassingLines::write(writes, count);
    for (std::size_t i = 0; i < count; ++i) {
      gate_.noteWritten(outputName(writes[i].output), writes[i].level);
    }
    return error;
  }
  std::size_t outputChip(int output) const override {
    return static_cast<std::size_t>(outputName(output).front());
  }

 private:
  Gate& gate_;
};

class GatedBackend : public gpio::Backend {
 public:
  GatedBackend(gpio::Backend& backend, Gate& gate) : backend_(backend), gate_(gate) {}
  std::unique_ptr<gpio::Lines> request(const std::vector<gpio::OutputRequest>& outputs,
                                       const std::vector<gpio::InputRequest>& inputs) override {
    return std::make_unique<GatedLines>(backend_.request(outputs, inputs), gate_);
  }

 private:
  gpio::Backend& backend_;
  Gate& gate_;
};

/// x, y and the output pen.
class SlowLines : public testing::Test {
 public:
  SlowLines()
      : axes_{linearAxis("x"), linearAxis("y")},
        options_(optionsWithPen()),
        rig_(Bench::rigAxes(axes_), nullptr, {}, {}, Bench::ioOf(options_)),
        lines_(rig_, [this] { return clock_.now(); }),
        backend_(lines_, gate_) {
    machine_ = std::make_unique<machine::Machine>(axes_, backend_, clock_, options_);
  }
  ~SlowLines() override { gate_.open(); }

 protected:
  static machine::MachineOptions optionsWithPen() {
    machine::MachineOptions options;
    options.write_timeout = 1.0;
    options.outputs.emplace_back();
    options.outputs[0].name = "pen";
    options.outputs[0].line = "pen.line";
    return options;
  }

  axis::Axis& axis(const std::string& name) { return machine_->axis(name); }
  machine::OutputState pen() const { return machine_->ioStates().outputs.at(0); }

  /// @return whether it has come true, however long that takes
  static bool comesTrue(const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + kLongestWait;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
  }

  /// The line of the pen, since the gate was closed.
  bool wasOnOnceAndIsOff() const {
    const std::vector<bool> levels = gate_.levels();
    return std::count(levels.begin(), levels.end(), true) == 1 && !levels.back();
  }

  /// The pulse thread hangs in the write that switches the pen on: nobody waits for it, and the pen
  /// is off when its chip has answered.
  void expectSafeAfterHang() {
    for (const char* name : {"x", "y"}) {
      EXPECT_TRUE(comesTrue([&] { return axis(name).state().fault == kWhy; }))
          << axis(name).state().fault;
      EXPECT_FALSE(axis(name).state().position_valid);
    }
    EXPECT_EQ(errorOf([this] { machine_->setOutput("pen", false); }), kWhy);
    EXPECT_EQ(errorOf([this] { machine_->stop(); }), kWhy);
    EXPECT_EQ(errorOf([this] { machine_->emergencyStop(); }), kWhy);
    EXPECT_EQ(errorOf([this] { axis("y").moveTo(0.01); }), kWhy);
    EXPECT_EQ(errorOf([this] { machine_->recover(); }), kWhy);
    EXPECT_TRUE(gate_.levels().empty());
    gate_.open();
    // Without recover().
    EXPECT_TRUE(comesTrue([this] { return wasOnOnceAndIsOff(); }))
        << testing::PrintToString(gate_.levels());
    EXPECT_TRUE(comesTrue([this] { return recovers(); }));
    EXPECT_TRUE(wasOnOnceAndIsOff()) << testing::PrintToString(gate_.levels());
    EXPECT_FALSE(pen().on);
    EXPECT_EQ(pen().error, "");
    EXPECT_EQ(violationsOf(rig_.report("x")) + violationsOf(rig_.report("y")), "");
    axis("x").setPosition(0.0);
    EXPECT_EQ(axis("x").wait(axis("x").moveTo(0.002)).end, MoveEnd::kReached);
  }

  bool recovers() {
    try {
      machine_->recover();
    } catch (const Refused&) {
      return false;
    }
    return true;
  }

  /// Calls it in a thread of its own. @return the error that it ended with.
  std::string errorOf(const std::function<void()>& call) {
    const auto run = [call]() -> std::string {
      try {
        call();
      } catch (const GpioError& error) {
        return error.what();
      }
      return "it succeeded";
    };
    std::future<std::string>& answer = calls_.emplace_back(std::async(std::launch::async, run));
    return answer.wait_for(kLongestWait) == std::future_status::ready ? answer.get() : "no answer";
  }

  static constexpr const char* kWhy =
      "the line pen.line of the output pen can't be written: ETIMEDOUT, the chip doesn't answer; "
      "check the cable and the supply of its chip";

  std::vector<config::AxisConfig> axes_;
  const machine::MachineOptions options_;
  pulse::VirtualClock clock_{1.0};
  sim::Rig rig_;
  gpio::SimulatedBackend lines_;
  Gate gate_;
  GatedBackend backend_;
  std::unique_ptr<machine::Machine> machine_;
  // They end when the gate is open.
  std::deque<std::future<std::string>> calls_;
  std::future<axis::MoveResult> waiting_;
  std::future<machine::CoordinatedResult> path_ends_;
};

TEST_F(SlowLines, AHungWriteIsAFaultThatNamesTheLineAndDelaysNoOtherAxis) {
  gate_.close("y.enable");
  auto disabled = std::async(std::launch::async, [this]() -> std::string {
    try {
      axis("y").enable(false);
      return "disabled";
    } catch (const GpioError& error) {
      return error.what();
    }
  });
  while (gate_.waited() == 0) std::this_thread::yield();
  // While the write hangs, all other requests are answered, and x moves.
  auto others = std::async(std::launch::async, [this] {
    const axis::MoveResult result = axis("x").wait(axis("x").moveTo(0.002));
    axis("x").stop();
    axis("y").stop();
    machine_->setSpeedOverride(0.5);
    return result.end;
  });
  ASSERT_EQ(others.wait_for(kLongestWait), std::future_status::ready);
  EXPECT_EQ(others.get(), MoveEnd::kReached);
  ASSERT_EQ(disabled.wait_for(kLongestWait), std::future_status::ready);
  EXPECT_EQ(
      disabled.get(),
      "y: the ENABLE line y.enable can't be written: ETIMEDOUT, the chip doesn't answer; check "
      "the cable and the supply of its chip");
  EXPECT_NE(axis("y").state().fault.find("y.enable"), std::string::npos);
  EXPECT_EQ(axis("x").state().fault, "");
  EXPECT_TRUE(axis("y").state().enabled) << "nobody knows that it is not";
  // The chip works again.
  gate_.open();
  machine_->recover();
  axis("y").enable(false);
  EXPECT_FALSE(rig_.report("y").energized);
  EXPECT_EQ(violationsOf(rig_.report("x")) + violationsOf(rig_.report("y")), "");
}

// What was reported as failed doesn't happen later.
TEST_F(SlowLines, AMotorWhoseEnableHungIsNotEnergizedWhenItsChipAnswersAgain) {
  axis("y").enable(false);
  gate_.close("y.enable");
  EXPECT_NE(
      errorOf([this] { axis("y").enable(true); }).find("y.enable can't be written: ETIMEDOUT"),
      std::string::npos);
  EXPECT_FALSE(axis("y").state().enabled);
  gate_.open();
  ASSERT_TRUE(comesTrue([this] { return gate_.levels().size() == 2; }));
  EXPECT_FALSE(rig_.report("y").energized);
  machine_->recover();
  EXPECT_FALSE(axis("y").state().enabled);
  axis("y").enable(true);
  EXPECT_TRUE(rig_.report("y").energized);
}

TEST_F(SlowLines, AnEmergencyStopIsServedWhileAWriteHangs) {
  gate_.close("y.enable");
  auto disabled = std::async(std::launch::async, [this] {
    try {
      axis("y").enable(false);
    } catch (const Error&) {
      return false;
    }
    return true;
  });
  while (gate_.waited() == 0) std::this_thread::yield();
  const axis::Move move = axis("x").moveTo(0.08);
  machine_->emergencyStop();
  EXPECT_EQ(axis("x").wait(move).end, MoveEnd::kEmergencyStop);
  ASSERT_EQ(disabled.wait_for(kLongestWait), std::future_status::ready);
  EXPECT_FALSE(disabled.get());
}

// The pulse thread waits for the line: no axis can step.
TEST_F(SlowLines, AHungWriteOfStepIsToldToAllWhoWaitAndNothingMovesWhenItReturns) {
  const axis::Move move = axis("x").moveTo(0.08);
  while (axis("x").state().position < 0.002) std::this_thread::yield();
  gate_.close("x.step");
  waiting_ = std::async(std::launch::async, [this, move] { return axis("x").wait(move); });
  ASSERT_EQ(waiting_.wait_for(kLongestWait), std::future_status::ready);
  const axis::MoveResult result = waiting_.get();
  EXPECT_EQ(result.end, MoveEnd::kFault);
  const std::string why =
      "x: the STEP line x.step can't be written: ETIMEDOUT, the chip doesn't answer; check the "
      "cable and the supply of its chip";
  EXPECT_EQ(result.message, why);
  for (const char* name : {"x", "y"}) {
    EXPECT_EQ(axis(name).state().fault, why);
    EXPECT_FALSE(axis(name).state().position_valid);
  }
  // Nobody is told that something has stopped, or waits for it.
  EXPECT_EQ(errorOf([this] { machine_->emergencyStop(); }), why);
  EXPECT_EQ(errorOf([this] { machine_->stop(); }), why);
  EXPECT_EQ(errorOf([this] { axis("x").stop(); }), why);
  EXPECT_EQ(errorOf([this] { axis("y").moveTo(0.01); }), why);
  EXPECT_EQ(errorOf([this] { machine_->recover(); }), why);

  // The chip answers again: at most the pulse of that write goes out.
  const std::int64_t before = rig_.report("x").pulses_forward;
  gate_.open();
  while (!machine_->whyHung().empty()) std::this_thread::yield();
  EXPECT_NE(axis("x").state().fault, "") << "only recover ends it";
  // It is refused until the pulse thread has ended all motions.
  ASSERT_TRUE(comesTrue([this] { return recovers(); }));
  EXPECT_FALSE(axis("x").state().moving);
  EXPECT_FALSE(axis("x").state().position_valid);
  const std::int64_t after = rig_.report("x").pulses_forward;
  EXPECT_LE(after, before + 1);
  EXPECT_EQ(rig_.report("y").pulses_forward, 0);
  EXPECT_EQ(std::llround(axis("x").state().position * 80'000.0), after);
  EXPECT_EQ(axis("x").wait(axis("x").moveTo(0.01)).end, MoveEnd::kReached);
  EXPECT_EQ(violationsOf(rig_.report("x")) + violationsOf(rig_.report("y")), "");
}

TEST_F(SlowLines, AHungWriteOfStepEndsTheCallsThatWaitForAnEmergencyStopOrTheEnd) {
  axis("x").moveTo(0.08);
  while (axis("x").state().position < 0.002) std::this_thread::yield();
  gate_.close("x.step");
  while (gate_.waited() == 0) std::this_thread::yield();
  const std::string why = "the STEP line x.step can't be written: ETIMEDOUT";
  EXPECT_NE(errorOf([this] { machine_->emergencyStop(); }).find(why), std::string::npos);
  EXPECT_NE(errorOf([this] { machine_->shutdown(); }).find(why), std::string::npos);
}

// ---- an output with a name ----

TEST_F(SlowLines, AHungWriteOfAnOutputIsAFaultThatNamesItAndEndsInItsSafeState) {
  for (const char* name : {"x", "y"}) axis(name).setPosition(0.0);
  gate_.close("pen.line");
  EXPECT_EQ(errorOf([this] { machine_->setOutput("pen", true); }), kWhy);
  for (const char* name : {"x", "y"}) {
    EXPECT_EQ(axis(name).state().fault, kWhy);
    EXPECT_TRUE(axis(name).state().position_valid) << "the pulse thread doesn't wait";
  }
  EXPECT_FALSE(pen().on);
  EXPECT_EQ(pen().error, kWhy);
  EXPECT_EQ(machine_->whyHung(), "");
  // The safe level can't be written either, which delays nobody for longer.
  EXPECT_EQ(errorOf([this] { machine_->recover(); }), kWhy);
  EXPECT_EQ(errorOf([this] { machine_->emergencyStop(); }), "it succeeded");
  EXPECT_EQ(errorOf([this] { machine_->stop(); }), "it succeeded");
  EXPECT_TRUE(gate_.levels().empty());
  // The write that hung is made, and the safe level after it.
  gate_.open();
  ASSERT_TRUE(comesTrue([this] { return wasOnOnceAndIsOff(); }))
      << testing::PrintToString(gate_.levels());
  machine_->recover();
  EXPECT_EQ(axis("x").state().fault, "");
  EXPECT_EQ(pen().error, "");
  EXPECT_FALSE(pen().on);
  machine_->setOutput("pen", true);
  EXPECT_TRUE(pen().on);
  EXPECT_TRUE(gate_.levels().back());
}

// The pulse thread waits for the line.
TEST_F(SlowLines, AnOutputOfAPathIsSafeAfterItsWriteHasHung) {
  gate_.close("pen.line");
  motion::PathRequest request{{"x"}, {}, true, 0.0, 0.0};
  request.segments.resize(3);
  request.segments[0].end = {0.01};
  request.segments[1].end = {0.02};
  request.segments[1].outputs = {{"pen", true}};
  request.segments[2].end = {0.03};
  request.segments[2].outputs = {{"pen", false}};
  const machine::CoordinatedMove move = machine_->followPath(request);
  path_ends_ = std::async(std::launch::async, [this, move] { return machine_->wait(move); });
  ASSERT_EQ(path_ends_.wait_for(kLongestWait), std::future_status::ready);
  const machine::CoordinatedResult result = path_ends_.get();
  EXPECT_EQ(result.end, MoveEnd::kFault);
  EXPECT_NE(result.message.find(kWhy), std::string::npos) << result.message;
  EXPECT_EQ(result.marks_made, 0U);
  EXPECT_EQ(result.marks_not_made, 0U);
  EXPECT_FALSE(result.marks_known);
  expectSafeAfterHang();
}

TEST_F(SlowLines, AnOutputOfAPositionIsSafeAfterItsWriteHasHung) {
  for (const char* name : {"x", "y"}) axis(name).setPosition(0.0);
  config::PositionCompare compare;
  compare.axis = "x";
  compare.places = {0.01};
  compare.pulse_ns = 10'000'000;
  machine_->setPositionCompare("pen", compare);
  gate_.close("pen.line");
  const axis::Move move = axis("x").moveTo(0.03);
  waiting_ = std::async(std::launch::async, [this, move] { return axis("x").wait(move); });
  ASSERT_EQ(waiting_.wait_for(kLongestWait), std::future_status::ready);
  const axis::MoveResult result = waiting_.get();
  EXPECT_EQ(result.end, MoveEnd::kFault);
  EXPECT_EQ(result.message, kWhy);
  expectSafeAfterHang();
  EXPECT_EQ(pen().axis, "x") << "recover leaves it to the position";
}

}  // namespace
}  // namespace stepdriver
