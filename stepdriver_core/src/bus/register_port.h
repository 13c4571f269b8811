#pragma once

#include <cstdint>
#include <string>

#include "port_error.h"

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
  kAllZeros,    ///< of an SPI device: the line from the chip is low all the time
  kAllOnes,     ///< the same, high
  kNotTaken,    ///< of an SPI device: the chip has heard another value than was written
};

/// In words, with the likely cause: "no chip answers, ...".
std::string causeOf(Failure failure);

/// The registers of the chips on a port. Nothing is believed that noise could have made.
class RegisterPort {
 public:
  virtual ~RegisterPort() = default;

  /// It counts when the chip has said it twice.
  /// @param volatile_bits that change at any time: two answers may differ in them.
  /// @throw PortError, as all below.
  Failure read(std::uint8_t address, std::uint8_t number, std::uint32_t volatile_bits,
               std::uint32_t& value);
  /// The same for a measured value, which is another one each time: it counts when the chip has
  /// said it once. Nothing may depend on it.
  Failure sample(std::uint8_t address, std::uint8_t number, std::uint32_t& value);
  /// Checked, as far as the chip lets it be.
  virtual Failure write(std::uint8_t address, std::uint8_t number, std::uint32_t value) = 0;
  /// Without a look at what comes of it, for chips that don't answer properly yet.
  virtual void writeUnchecked(std::uint8_t address, std::uint8_t number, std::uint32_t value) = 0;

  /// Reads and writes that succeeded.
  std::uint64_t transactions() const { return transactions_; }
  /// Tries that failed.
  std::uint64_t retries() const { return retries_; }

 protected:
  static constexpr int kTries = 3;

  virtual Failure readOnce(std::uint8_t address, std::uint8_t number, std::uint32_t& value) = 0;

  std::uint64_t transactions_ = 0;
  std::uint64_t retries_ = 0;
};

}  // namespace stepdriver::bus
