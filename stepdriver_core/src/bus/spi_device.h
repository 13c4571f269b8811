#pragma once

#include <cstddef>
#include <cstdint>

#include "port_error.h"

namespace stepdriver::bus {

/// A chip on an SPI bus, with a chip select of its own.
class SpiDevice {
 public:
  virtual ~SpiDevice() = default;
  /// Sends bytes, and hears as many at the same time. @throw PortError
  virtual void transfer(const std::uint8_t* sent, std::uint8_t* heard, std::size_t count) = 0;
};

}  // namespace stepdriver::bus
