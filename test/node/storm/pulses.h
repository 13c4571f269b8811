#pragma once

#include <map>
#include <string>
#include <vector>

#include "storm/oracle.h"
#include "support/vcd_reader.h"

namespace stepdriver::storm {

/// The pulses of an A4988 with microstep pins, of a driver with registers, or of a motor of phases,
/// from its trace.
std::vector<Pulse> pulsesOf(const std::map<std::string, node_test::Waveform>& trace,
                            const std::string& axis);

}  // namespace stepdriver::storm
