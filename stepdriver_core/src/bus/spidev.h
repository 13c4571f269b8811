#pragma once

#include <string>

#include "spi_device.h"

namespace stepdriver::bus {

/// A device of the kernel's spidev driver, in the mode of Trinamic's drivers: SPI mode 3, 8 bits.
/// No other program that asks for it can use it meanwhile.
class Spidev : public SpiDevice {
 public:
  /// @param path such as /dev/spidev0.0 @param rate [Hz] of its clock, at most
  /// @throw PortError if it can't be opened, is in use, or has no such mode.
  Spidev(std::string path, int rate);
  ~Spidev() override;
  Spidev(const Spidev&) = delete;
  Spidev& operator=(const Spidev&) = delete;

  void transfer(const std::uint8_t* sent, std::uint8_t* heard, std::size_t count) override;

 private:
  void setUp(int rate) const;

  const std::string path_;
  int file_ = -1;
};

}  // namespace stepdriver::bus
