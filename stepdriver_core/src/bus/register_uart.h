#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "byte_stream.h"
#include "register_port.h"

namespace stepdriver::bus {

/// The registers of the chips on a wire. A value counts when the chip has said it twice, and a
/// write when the chip has counted it (IFCNT) and the wire has carried the bytes that were sent.
class RegisterUart : public RegisterPort {
 public:
  /// @param stream outlives it.
  RegisterUart(ByteStream& stream, int baud);
  RegisterUart(std::unique_ptr<ByteStream> stream, int baud);

  Failure write(std::uint8_t address, std::uint8_t number, std::uint32_t value) override;
  void writeUnchecked(std::uint8_t address, std::uint8_t number, std::uint32_t value) override;

 private:
  struct Heard {
    std::array<std::uint8_t, 32> bytes{};
    std::size_t count = 0;
  };

  /// Sends bytes, and hears what is on the wire until so many have come, or too many, or no more.
  Heard exchange(const std::uint8_t* bytes, std::size_t count, std::size_t expected);
  Failure readOnce(std::uint8_t address, std::uint8_t number, std::uint32_t& value) override;

  const std::unique_ptr<ByteStream> own_stream_;  // nullptr: it belongs to somebody else
  ByteStream& stream_;
  const std::int64_t byte_ns_;
};

}  // namespace stepdriver::bus
