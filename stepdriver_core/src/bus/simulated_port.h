#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <utility>
#include <vector>

#include "byte_stream.h"
#include "spi_device.h"

namespace stepdriver::bus {

/// A serial port of a simulated board. It needs no time: what isn't heard at once never comes.
class SimulatedPort : public ByteStream {
 public:
  /// Sends bytes, with or without a pause since the last ones. @return what is heard.
  using Exchange = std::function<std::vector<std::uint8_t>(const std::uint8_t* bytes,
                                                           std::size_t count, bool pause)>;
  explicit SimulatedPort(Exchange exchange) : exchange_(std::move(exchange)) {}

  void send(const std::uint8_t* bytes, std::size_t count) override;
  std::size_t receive(std::uint8_t* bytes, std::size_t most, std::int64_t timeout_ns) override;

 private:
  const Exchange exchange_;
  std::deque<std::uint8_t> heard_;
  bool pauses_ = true;
};

/// An SPI device of a simulated board.
class SimulatedSpi : public SpiDevice {
 public:
  explicit SimulatedSpi(SimulatedPort::Exchange exchange) : exchange_(std::move(exchange)) {}

  void transfer(const std::uint8_t* sent, std::uint8_t* heard, std::size_t count) override;

 private:
  const SimulatedPort::Exchange exchange_;
};

}  // namespace stepdriver::bus
