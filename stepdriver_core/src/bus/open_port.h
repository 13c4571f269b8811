#pragma once

#include <memory>
#include <string>

#include "register_port.h"
#include "simulated_port.h"

namespace stepdriver::bus {

/// Opens a port of this computer, or of a simulated board, to the registers of chips.
/// @param baud 0: it is an SPI device; otherwise the rate of a serial port.
/// @param exchange empty: it is one of this computer. @throw PortError
std::unique_ptr<RegisterPort> openPort(const std::string& port, int baud,
                                       SimulatedPort::Exchange exchange);

}  // namespace stepdriver::bus
