#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "port/klipper/board_backend.h"
#include "setup/simulated_link.h"
#include "sim/fake_board.h"
#include "support/bench.h"
#include "support/port_on_board.h"
#include "support/recording_lines.h"

// A whole machine whose motor is on a board.

namespace stepdriver::klipper {
namespace {

class MachineOnBoard : public testing::Test {
 protected:
  static config::AxisConfig axisOnBoard() {
    config::AxisConfig config = test::linearAxis("x");
    config.pins = {};
    config.pins.step.line = "mcu:gpio2";
    config.pins.dir.line = "mcu:gpio3";
    config.pins.enable.line = "mcu:gpio4";
    config.endstop_min.reset();
    config.endstop_max.reset();
    return config;
  }

  pulse::VirtualClock clock_;
  test::RecordingLines lines_{clock_};
  test::PinsOnLines pins_{lines_};
  sim::FakeBoard board_{pins_, sim::rp2040()};
  test::NoBackend no_lines_;
  BoardBackend backend_{no_lines_, clock_, {{"mcu", "fake"}}, [this](const BoardSettings& /*of*/) {
                          return std::make_unique<setup::SimulatedLink>(board_, clock_);
                        }};
};

TEST_F(MachineOnBoard, SaysInTheFaultOfAnAxisWhyItsFirmwareHasShutDown) {
  test::UnthreadedMachine machine({axisOnBoard()}, backend_, clock_);
  const axis::Move move = machine.axis("x").moveTo(0.05);
  machine.advance(0.2);
  ASSERT_GT(lines_.rises(2).size(), 100U);
  board_.shutDown("Timer too close");
  const axis::MoveResult result = machine.axis("x").wait(move);
  EXPECT_EQ(result.end, axis::MoveEnd::kFault);
  const axis::AxisState state = machine.axis("x").state();
  EXPECT_EQ(state.fault,
            "the STEP line mcu:gpio2 can't be written: the firmware of the board mcu has shut "
            "down: Timer too close; start the node again");
  EXPECT_FALSE(state.position_valid);
}

}  // namespace
}  // namespace stepdriver::klipper
