#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "byte_stream.h"

namespace stepdriver::bus {

/// Why a register could not be read or written.
enum class Failure {
  kNone,
  kPort,        ///< the port can't be opened, or is gone
  kNothing,     ///< not even the bytes that were sent came back
  kOnlyEcho,    ///< no chip answers
  kNoEcho,      ///< an answer without the bytes that were sent
  kGarbled,     ///< other bytes than those of an answer
  kUnsettled,   ///< two answers that differ
  kNotCounted,  ///< the chip hasn't counted a write
  kStray,       ///< the chip has counted a write that was garbled: any register may be wrong
  kMismatch,    ///< it was read back with another value
};

/// In words, with the likely cause: "no chip answers, ...".
std::string causeOf(Failure failure);

/// The registers of the chips on a wire. Nothing is believed that noise could have made: a value
/// counts when the chip has said it twice, and a write when the chip has counted it (IFCNT) and the
/// wire has carried the bytes that were sent.
class RegisterUart {
 public:
  /// @param stream outlives it.
  RegisterUart(ByteStream& stream, int baud);

  /// [bits] that change at any time: two answers may differ in them.
  /// @throw PortError
  Failure read(std::uint8_t address, std::uint8_t number, std::uint32_t volatile_bits,
               std::uint32_t& value);
  /// The same for a measured value, which is another one each time: it counts when the chip has
  /// said it once. Nothing may depend on it. @throw PortError
  Failure sample(std::uint8_t address, std::uint8_t number, std::uint32_t& value);
  /// @throw PortError
  Failure write(std::uint8_t address, std::uint8_t number, std::uint32_t value);
  /// Without a look at what comes of it, for chips that don't answer properly yet. @throw PortError
  void writeUnchecked(std::uint8_t address, std::uint8_t number, std::uint32_t value);

  /// Reads and writes that succeeded.
  std::uint64_t transactions() const { return transactions_; }
  /// Tries that failed.
  std::uint64_t retries() const { return retries_; }

 private:
  struct Heard {
    std::array<std::uint8_t, 32> bytes{};
    std::size_t count = 0;
  };

  /// Sends bytes, and hears what is on the wire until so many have come, or too many, or no more.
  Heard exchange(const std::uint8_t* bytes, std::size_t count, std::size_t expected);
  Failure readOnce(std::uint8_t address, std::uint8_t number, std::uint32_t& value);

  ByteStream& stream_;
  const std::int64_t byte_ns_;
  std::uint64_t transactions_ = 0;
  std::uint64_t retries_ = 0;
};

}  // namespace stepdriver::bus
