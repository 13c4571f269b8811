#include <gtest/gtest.h>

#include <cerrno>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gpio/may_wait.h"
#include "gpio/pwm_backend.h"
#include "port/klipper/board_backend.h"
#include "setup/simulated_link.h"
#include "sim/fake_board.h"
#include "support/bench.h"
#include "support/making_backend.h"
#include "support/port_on_board.h"
#include "support/pwm_folder.h"
#include "support/recording_lines.h"
#include "support/refusal.h"

// A whole machine whose motors are on boards.

namespace stepdriver::klipper {
namespace {

constexpr int kStepPin = 2;
constexpr int kEnablePin = 4;
constexpr const char* kLaser = "pwmchip0:1/200000/0/200000";
constexpr int kButton = 0;  // the input of pin PinsOnLines::kFirstInput

/// A fake board with a cable that can be pulled.
class CabledBoard {
 public:
  explicit CabledBoard(pulse::VirtualClock& clock) : lines(clock), clock_(clock) { replace(); }

  /// Another board at the same port. @param lacks a command of its firmware, by its whole format
  void replace(const std::string& lacks = "") {
    sim::BoardKind kind = sim::rp2040();
    kind.pins = 80;
    board = std::make_unique<sim::FakeBoard>(pins_, kind);
    if (!lacks.empty()) board->lack(lacks);
  }

  std::unique_ptr<Link> link(const std::string& name) {
    if (is_pulled_) throw BoardError("the port of the board " + name + " can't be used");
    return std::make_unique<Cable>(*this);
  }

  void pull() {
    is_pulled_ = true;
    ++pulls_;
  }
  void plugIn() { is_pulled_ = false; }

  test::RecordingLines lines;
  std::unique_ptr<sim::FakeBoard> board;

 private:
  class Cable : public Link {
   public:
    explicit Cable(CabledBoard& of) : of_(of), pulls_(of.pulls_), link_(*of.board, of.clock_) {}
    std::ptrdiff_t write(const std::uint8_t* bytes, std::size_t count) noexcept override {
      return isDead() ? -ENODEV : link_.write(bytes, count);
    }
    std::ptrdiff_t read(std::uint8_t* bytes, std::size_t most) noexcept override {
      return isDead() ? -ENODEV : link_.read(bytes, most);
    }
    void await(Nanoseconds timeout) override { link_.await(timeout); }
    Nanoseconds due() const override { return isDead() ? pulse::kNever : link_.due(); }

   private:
    // A port that was opened before doesn't come back.
    bool isDead() const { return of_.pulls_ != pulls_; }

    CabledBoard& of_;
    const int pulls_;
    setup::SimulatedLink link_;
  };

  pulse::VirtualClock& clock_;
  test::PinsOnLines pins_{lines};
  bool is_pulled_ = false;
  int pulls_ = 0;
};

class MachineOnBoard : public testing::Test {
 protected:
  static config::AxisConfig axisOn(const std::string& board, const std::string& name) {
    config::AxisConfig config = test::linearAxis(name);
    config.pins = {};
    config.pins.step.line = board + ":gpio2";
    config.pins.dir.line = board + ":gpio3";
    config.pins.enable.line = board + ":gpio4";
    config.endstop_min.reset();
    config.endstop_max.reset();
    return config;
  }

  void make(const std::vector<config::AxisConfig>& axes,
            const machine::MachineOptions& options = {}) {
    machine_ = std::make_unique<test::UnthreadedMachine>(axes, backend_, clock_, options);
  }
  std::int64_t steps(const CabledBoard& board) const {
    return static_cast<std::int64_t>(board.lines.rises(kStepPin).size());
  }
  /// The board plays what it has although nobody is at its line.
  void playAlone(CabledBoard& board, double seconds) {
    for (int i = 0; i < static_cast<int>(seconds * 1e3); ++i) {
      machine_->advance(1e-3);
      board.board->play(clock_.now());
    }
  }
  /// A move of 10 mm, exact by the steps at the board.
  void expectToMoveExactly(const std::string& axis, CabledBoard& board) {
    const std::int64_t before = steps(board);
    const axis::MoveResult result =
        machine_->axis(axis).wait(machine_->axis(axis).moveTo(0.01, true));
    EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
    EXPECT_EQ(steps(board) - before, 800);
  }

  pulse::VirtualClock clock_;
  CabledBoard mcu_{clock_};
  CabledBoard other_{clock_};
  test::NoBackend no_lines_;
  BoardBackend backend_{
      no_lines_, clock_, {{"mcu", "fake"}, {"other", "fake"}}, [this](const BoardSettings& board) {
        return (board.name == "mcu" ? mcu_ : other_).link(board.name);
      }};
  std::unique_ptr<test::UnthreadedMachine> machine_;
};

TEST_F(MachineOnBoard, SaysInTheFaultOfAnAxisWhyItsFirmwareHasShutDown) {
  make({axisOn("mcu", "x")});
  const axis::Move move = machine_->axis("x").moveTo(0.05);
  machine_->advance(0.2);
  ASSERT_GT(steps(mcu_), 100);
  mcu_.board->shutDown("Timer too close");
  const axis::MoveResult result = machine_->axis("x").wait(move);
  EXPECT_EQ(result.end, axis::MoveEnd::kFault);
  const axis::AxisState state = machine_->axis("x").state();
  EXPECT_EQ(state.fault,
            "the STEP line mcu:gpio2 can't be written: the firmware of the board mcu has shut "
            "down: Timer too close");
  EXPECT_FALSE(state.position_valid);
}

TEST_F(MachineOnBoard, APwmOutputOfTheComputerHasItsValueAndItsFailure) {
  const test::PwmFolder folder;
  const auto pwm =
      gpio::withPwm(std::make_unique<test::MakingBackend>([this](const auto&, const auto&) {
                      return std::make_unique<test::RecordingLines>(clock_);
                    }),
                    folder.root());
  BoardBackend backend(*pwm, clock_, {{"mcu", "fake"}},
                       [this](const BoardSettings& board) { return mcu_.link(board.name); });
  const auto lines = backend.request({{"mcu:gpio4", false, false}, {kLaser, false, false}}, {});
  const gpio::LineWrite quarter{1, true, gpio::LineWrite::kWhole / 4};
  EXPECT_EQ(lines->write(&quarter, 1), 0);
  EXPECT_NEAR(std::stod(folder.read("pwm1/duty_cycle")), 50'000.0, 5.0);
  folder.fill("pwm1/duty_cycle");
  gpio::this_thread_may_wait = false;
  EXPECT_EQ(lines->write(&quarter, 1), 0);
  gpio::this_thread_may_wait = true;
  gpio::LateWrites late = lines->lateWrites(1);
  for (; late.ended < late.ordered; late = lines->lateWrites(1)) std::this_thread::yield();
  EXPECT_EQ(late.failed, late.ordered);
  EXPECT_EQ(late.error, ENOSPC);
  EXPECT_EQ(lines->lateWrites(0).ordered, 0U);
}

// ---- recover ----

struct BadDay {
  const char* name;
  std::function<void(CabledBoard&, const std::function<void(double)>& pass)> happen;
};

/// Each ends with a board that can be used again.
const BadDay kBadDays[] = {
    {"the firmware shuts down",
     [](CabledBoard& board, const auto& /*pass*/) { board.board->shutDown("Timer too close"); }},
    {"the board is reset",
     [](CabledBoard& board, const auto& /*pass*/) { board.board->powerCycle(); }},
    {"the cable is pulled for a second",
     [](CabledBoard& board, const auto& pass) {
       board.pull();
       pass(1.0);
       board.plugIn();
     }},
    {"the cable is pulled for ten seconds",
     [](CabledBoard& board, const auto& pass) {
       board.pull();
       pass(10.0);
       board.plugIn();
     }},
    {"the cable with the power of the board is pulled",
     [](CabledBoard& board, const auto& pass) {
       board.pull();
       pass(0.01);
       board.board->powerCycle();
       pass(1.0);
       board.plugIn();
     }},
};

TEST_F(MachineOnBoard, MovesAgainAfterEachBadDayAndRecover) {
  make({axisOn("mcu", "x"), axisOn("other", "y")});
  axis::Axis& x = machine_->axis("x");
  std::mt19937 random(7);
  for (int round = 0; round < 40; ++round) {
    const BadDay& day = kBadDays[static_cast<std::size_t>(round) % std::size(kBadDays)];
    SCOPED_TRACE(testing::Message() << day.name << ", round " << round);
    x.setPosition(0.0);
    ASSERT_TRUE(x.state().position_valid);
    const bool moves = round % 3 != 2;
    const std::int64_t before = steps(mcu_);
    if (moves) x.moveTo(round % 2 == 0 ? 0.08 : -0.08);
    machine_->advance(1e-4 * static_cast<double>(random() % 8'000));
    day.happen(mcu_, [this](double seconds) { playAlone(mcu_, seconds); });
    machine_->advance(0.1);
    axis::AxisState state = x.state();
    ASSERT_NE(state.fault, "");
    ASSERT_FALSE(state.position_valid);
    ASSERT_EQ(machine_->axis("y").state().fault, "") << "its board is well";
    if (!moves) {
      ASSERT_EQ(steps(mcu_), before);
    }

    machine_->recover();
    state = x.state();
    ASSERT_EQ(state.fault, "");
    ASSERT_FALSE(state.position_valid) << "nobody has proven it";
    ASSERT_TRUE(state.enabled);
    machine_->advance(0.01);
    ASSERT_FALSE(mcu_.lines.levels[kEnablePin]) << "low enables";
    expectToMoveExactly("x", mcu_);
    expectToMoveExactly("y", other_);
    ASSERT_EQ(mcu_.board->droppedMoves(), 0U);
    ASSERT_EQ(mcu_.board->pushedBack(), 0U);
  }
}

// The outputs of a board that was away have their safe levels, until its axes are recovered.
TEST_F(MachineOnBoard, SwitchesTheMotorOffThatWasDisabledBeforeTheBadDay) {
  for (const BadDay& day : kBadDays) {
    SCOPED_TRACE(day.name);
    machine_.reset();
    mcu_.replace();
    make({axisOn("mcu", "x")});
    machine_->axis("x").enable(false);
    machine_->advance(0.1);
    day.happen(mcu_, [this](double seconds) { playAlone(mcu_, seconds); });
    machine_->advance(0.1);
    machine_->recover();
    machine_->advance(0.1);
    EXPECT_TRUE(mcu_.lines.levels[kEnablePin]) << "high disables";
    EXPECT_FALSE(machine_->axis("x").state().enabled);
  }
}

TEST_F(MachineOnBoard, StaysAtFaultWhileTheBoardIsMissingAndTheOtherAxesRecover) {
  make({axisOn("mcu", "x"), axisOn("other", "y")});
  mcu_.pull();
  other_.board->shutDown("Timer too close");
  machine_->advance(0.1);
  ASSERT_NE(machine_->axis("x").state().fault, "");
  ASSERT_NE(machine_->axis("y").state().fault, "");
  for (int i = 0; i < 3; ++i) {
    EXPECT_REFUSED(machine_->recover(),
                   "x: at fault: the STEP line mcu:gpio2 can't be written: the port of the board "
                   "mcu can't be used");
    EXPECT_NE(machine_->axis("x").state().fault, "");
    EXPECT_REFUSED(machine_->axis("x").moveTo(0.01), "call recover first");
    EXPECT_EQ(machine_->axis("y").state().fault, "");
    expectToMoveExactly("y", other_);
  }
  mcu_.plugIn();
  machine_->recover();
  expectToMoveExactly("x", mcu_);
}

TEST_F(MachineOnBoard, RefusesAnotherBoardOrFirmwareAtItsPort) {
  make({axisOn("mcu", "x")});
  mcu_.pull();
  machine_->advance(0.1);
  mcu_.plugIn();
  mcu_.replace("stepper_stop_on_trigger oid=%c trsync_oid=%c");
  EXPECT_REFUSED(machine_->recover(), "the board mcu has another firmware now");
  mcu_.replace();
  mcu_.board->configuredBy(1234);
  EXPECT_REFUSED(machine_->recover(), "was configured by another program");
  mcu_.replace();
  machine_->recover();
  expectToMoveExactly("x", mcu_);
}

// The input can't be read while its board is away, which counts as a pressed button.
TEST_F(MachineOnBoard, RecoversAnEmergencyStopInputOnTheBoard) {
  machine::MachineOptions options;
  options.emergency_stop.emplace();
  options.emergency_stop->line =
      "mcu:gpio" + std::to_string(test::PinsOnLines::kFirstInput + kButton);
  options.emergency_stop->active_level = true;
  make({axisOn("mcu", "x")}, options);
  mcu_.board->powerCycle();
  machine_->advance(0.1);
  mcu_.lines.inputs[kButton] = 1;
  EXPECT_REFUSED(machine_->recover(), "is active; release it");
  mcu_.lines.inputs[kButton] = 0;
  machine_->advance(0.1);  // it is read every 20 ms
  machine_->recover();
  expectToMoveExactly("x", mcu_);
}

// ---- switches that share a line ----

config::Endstop sharedSwitchOnBoard() {
  config::Endstop endstop;
  endstop.line = "mcu:gpio7";
  endstop.shared = true;
  return endstop;
}

template <typename Open>
std::string whyNotOpened(const Open& open) {
  try {
    open();
  } catch (const BoardError& error) {
    return error.what();
  }
  return "";
}

TEST_F(MachineOnBoard, RefusesASwitchOfBothEnds) {
  config::AxisConfig x = axisOn("mcu", "x");
  x.endstop_min = x.endstop_max = sharedSwitchOnBoard();
  x.switch_release = 0.002;
  EXPECT_EQ(whyNotOpened([&] { make({x}); }),
            "Line mcu:gpio2 is on a board, which can't tell at which end a switch of both is "
            "pressed: its ends need a line each.");
}

TEST_F(MachineOnBoard, RefusesASwitchOfSeveralAxes) {
  config::AxisConfig x = axisOn("mcu", "x");
  x.endstop_min = sharedSwitchOnBoard();
  config::AxisConfig y = x;
  y.name = y.joint = "y";
  y.pins.step.line = "mcu:gpio10";
  y.pins.dir.line = "mcu:gpio11";
  EXPECT_EQ(whyNotOpened([&] {
              make({x, y});
            }),
            "Line mcu:gpio7 stops the motors of several axes: on a board each needs a line of "
            "its own.");
}

}  // namespace
}  // namespace stepdriver::klipper
