#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "storm/oracle.h"
#include "support/node_under_test.h"

namespace stepdriver::storm {

/// The timeout of the machine's jogs and setpoints, in seconds.
constexpr double kJogTimeout = 0.2;
/// The axis whose driver has registers, and its highest current [A rms].
constexpr std::size_t kWithRegisters = 1;
constexpr double kHighestCurrent = 0.8;

/// Gives a node three linear axes of 20 steps/mm: x, with homing, switches, microstep pins, sleep
/// and reset, and a stop that is slower than its speed suggests; y, with 8 mm of backlash and a
/// driver on a UART, which shares the ENABLE line of x; z, with S-curves and an idle timeout.
/// Positions are from -50 mm to 150 mm. A relay with a feedback switches the power of all motors.
///
/// @return the oracle's data about them.
std::vector<AxisFacts> setUpMachine(node_test::NodeUnderTest& node);

}  // namespace stepdriver::storm
