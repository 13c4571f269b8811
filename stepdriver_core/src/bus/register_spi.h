#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "register_port.h"
#include "spi_device.h"

namespace stepdriver::bus {

/// The registers of one of Trinamic's drivers on SPI (TMC2130 datasheet rev. 1.15, section 4):
/// datagrams of 40 bits, the high byte first. What the chip answers to a datagram comes with the
/// next one: the value that was read, or after a write the value that it has heard. A read counts
/// when the chip has said it twice, a write when it has heard it.
class RegisterSpi : public RegisterPort {
 public:
  explicit RegisterSpi(std::unique_ptr<SpiDevice> device);

  Failure write(std::uint8_t address, std::uint8_t number, std::uint32_t value) override;
  void writeUnchecked(std::uint8_t address, std::uint8_t number, std::uint32_t value) override;

 private:
  using Datagram = std::array<std::uint8_t, 5>;

  Datagram exchange(std::uint8_t first, std::uint32_t value);
  Failure takeAnswer(std::uint32_t& value);
  Failure readOnce(std::uint8_t address, std::uint8_t number, std::uint32_t& value) override;

  const std::unique_ptr<SpiDevice> device_;
};

}  // namespace stepdriver::bus
