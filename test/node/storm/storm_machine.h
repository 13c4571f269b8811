#pragma once

#include <cstddef>
#include <cstdint>
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

/// Two machines with three linear axes of 20 steps/mm, from -50 mm to 150 mm: x, with switches,
/// microstep pins, sleep and reset, and a stop that is slower than its speed suggests; y, with 8 mm
/// of backlash and a driver on a UART, which shares the ENABLE line of x; z, with S-curves and an
/// idle timeout. A relay with a feedback switches the power of all motors.
enum class StormMachine {
  kSwitches,  ///< x is homed to its min switch, z to a flag
  /// x is homed against a block, and z has a motor of phases, and a line that the switches of both
  /// its ends share.
  kPhases,
};

/// The one of a seed.
StormMachine machineOf(std::uint64_t seed);

/// Gives a node such a machine. @return the oracle's data about its axes.
std::vector<AxisFacts> setUpMachine(node_test::NodeUnderTest& node, StormMachine machine);

/// The services of its rig that press its switches.
std::vector<std::string> switchesOf(StormMachine machine);
/// The microsteps that z may have.
std::vector<int> microstepsOfZ(StormMachine machine);

}  // namespace stepdriver::storm
