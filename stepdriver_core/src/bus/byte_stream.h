#pragma once

#include <cstddef>
#include <cstdint>

#include "stepdriver_core/error.h"

namespace stepdriver::bus {

/// A serial port can't be opened, or has gone: its text says why, and what helps.
class PortError : public Error {
 public:
  using Error::Error;
};

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
