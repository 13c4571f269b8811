#include "open_port.h"

#include <utility>

#include "register_spi.h"
#include "register_uart.h"
#include "serial_port.h"
#include "spidev.h"

namespace stepdriver::bus {
namespace {

// The chips take 4 MHz with their own clock; long wires don't.
constexpr int kSpiRate = 1'000'000;

std::unique_ptr<SpiDevice> openSpi(const std::string& port, SimulatedPort::Exchange exchange) {
  if (exchange) return std::make_unique<SimulatedSpi>(std::move(exchange));
  return std::make_unique<Spidev>(port, kSpiRate);
}

std::unique_ptr<ByteStream> openSerial(const std::string& port, int baud,
                                       SimulatedPort::Exchange exchange) {
  if (exchange) return std::make_unique<SimulatedPort>(std::move(exchange));
  return std::make_unique<SerialPort>(port, baud);
}

}  // namespace

std::unique_ptr<RegisterPort> openPort(const std::string& port, int baud,
                                       SimulatedPort::Exchange exchange) {
  if (baud == 0) return std::make_unique<RegisterSpi>(openSpi(port, std::move(exchange)));
  return std::make_unique<RegisterUart>(openSerial(port, baud, std::move(exchange)), baud);
}

}  // namespace stepdriver::bus
