#pragma once

#include <memory>
#include <string>

#include "simulated_port.h"

namespace stepdriver::bus {

/// Opens a serial port of this computer, or of a simulated board.
/// @param exchange empty: it is one of this computer. @throw PortError
std::unique_ptr<ByteStream> openPort(const std::string& port, int baud,
                                     SimulatedPort::Exchange exchange);

}  // namespace stepdriver::bus
