#pragma once

#include <memory>

#include "core/support/gpio_sim.h"
#include "hardware/hardware_node.h"
#include "hardware/line_record.h"
#include "hardware/needs_gpio_sim.h"

namespace stepdriver::node_test {

/// A HardwareNode that isn't started yet, its two chips, and a record of what the kernel does to
/// their lines.
class BoardAndExpander : public NeedsGpioSim {
 protected:
  void SetUp() override {
    NeedsGpioSim::SetUp();
    if (IsSkipped()) return;
    const unsigned lines = HardwareNode::kLinesOfChip;
    board = std::make_unique<test::GpioSimChip>("board", "board", lines);
    expander = std::make_unique<test::GpioSimChip>("expander", "expander", lines);
    record = std::make_unique<LineRecord>();
    node = std::make_unique<HardwareNode>();
  }
  void TearDown() override { node.reset(); }

  std::unique_ptr<test::GpioSimChip> board;
  std::unique_ptr<test::GpioSimChip> expander;
  std::unique_ptr<LineRecord> record;
  std::unique_ptr<HardwareNode> node;
};

}  // namespace stepdriver::node_test
