#pragma once

#include <stepdriver/AxisStates.h>

#include <cstdint>
#include <string>

#include "support/node_under_test.h"

namespace stepdriver::node_test {

/// A NodeUnderTest on GPIO lines. Its axes x and y, with A4988s, are on the chip "board"; z, with a
/// DRV8825 and its fault line, is on the chip "expander", and so is the switch of y. 80 steps/mm,
/// at most 2 mm/s (y 1.9) and 500 mm/s^2, enabled on start: a virtual machine with one CPU can
/// sustain that, with time left for the node.
class HardwareNode : public NodeUnderTest {
 public:
  HardwareNode();

  /// Offsets of the lines on their chip.
  struct Axis {
    unsigned step, dir, enable, sleep, reset, max;
  };
  static constexpr Axis kX{0, 1, 2, 3, 4, 5};
  static constexpr Axis kY{8, 9, 10, 11, 12, 13};
  static constexpr Axis kZ{0, 1, 2, 3, 4, 5};
  static constexpr unsigned kZFault = 6;
  static constexpr unsigned kLinesOfChip = 16;

  /// [microsteps] The count of any axis at a position [m].
  static std::int64_t stepsOf(double position);

  MoveTo::Response move(const std::string& axis, double position, bool wait);

 private:
  void setAxis(const std::string& axis, const std::string& driver, const std::string& chip,
               const Axis& lines);
};

}  // namespace stepdriver::node_test
