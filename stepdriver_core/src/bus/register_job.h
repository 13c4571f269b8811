#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "register_port.h"

namespace stepdriver::bus {

/// One access to a register.
struct RegisterAccess {
  enum class Kind {
    kRead,       ///< its value is a result
    kSample,     ///< the same, of a measured value that is another one each time
    kExpect,     ///< a read whose value must be this one in the bits of the mask
    kWrite,      ///< counted by the chip
    kWriteBack,  ///< counted by the chip, and read back
    kUnchecked,  ///< a write without a look at what comes of it
  };
  Kind kind = Kind::kRead;
  std::uint8_t address = 0;
  std::uint8_t number = 0;
  std::uint32_t value = 0;
  /// Of an expectation, the bits that count; of a read, those that change at any time.
  std::uint32_t mask = 0;
};

/// Accesses to the chips of one port, in their order; the first that fails ends it.
struct RegisterJob {
  std::uint64_t id = 0;
  std::string port;   ///< as configured
  int baud = 115200;  ///< 0: it is an SPI device
  std::vector<RegisterAccess> accesses;
  /// It writes all registers of the chip. If a damaged write may have changed another one, it
  /// begins again.
  bool writes_all = false;
};

/// Its result.
struct RegisterDone {
  std::uint64_t id = 0;
  std::vector<std::uint32_t> values;  ///< of each access until the one that failed
  Failure failure = Failure::kNone;
  std::uint8_t failed_number = 0;  ///< of the register at which it failed
  std::uint32_t found = 0;         ///< there, if it has another value
  std::string port_error;          ///< of Failure::kPort
  std::uint64_t transactions = 0;
  std::uint64_t retries = 0;
};

/// Carries out the accesses of a job.
/// @param ends asked before each access: whether to give up. May be empty.
/// @throw PortError
RegisterDone carryOut(const RegisterJob& job, RegisterPort& port,
                      const std::function<bool()>& ends);

}  // namespace stepdriver::bus
