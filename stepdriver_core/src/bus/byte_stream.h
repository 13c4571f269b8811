#pragma once

#include <cstddef>
#include <cstdint>

#include "port_error.h"

namespace stepdriver::bus {

/// Bytes in both directions.
class ByteStream {
 public:
  virtual ~ByteStream() = default;
  /// Sends all of them. @throw PortError
  virtual void send(const std::uint8_t* bytes, std::size_t count) = 0;
  /// Waits until there are bytes, at most for this time.
  /// @return how many were received; 0: none in this time. @throw PortError
  virtual std::size_t receive(std::uint8_t* bytes, std::size_t most, std::int64_t timeout_ns) = 0;
};

}  // namespace stepdriver::bus
