#include "open_port.h"

#include <utility>

#include "serial_port.h"

namespace stepdriver::bus {

std::unique_ptr<ByteStream> openPort(const std::string& port, int baud,
                                     SimulatedPort::Exchange exchange) {
  if (exchange) return std::make_unique<SimulatedPort>(std::move(exchange));
  return std::make_unique<SerialPort>(port, baud);
}

}  // namespace stepdriver::bus
