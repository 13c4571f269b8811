#pragma once

#include <cstddef>
#include <cstdint>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::klipper {

/// The line to a board: bytes in both directions. For one thread at a time.
class Link {
 public:
  virtual ~Link() = default;

  /// @name They don't wait
  /// @{
  /// @return how many bytes were taken, perhaps 0; or -errno.
  virtual std::ptrdiff_t write(const std::uint8_t* bytes, std::size_t count) noexcept = 0;
  /// @return how many bytes were there, perhaps 0; or -errno.
  virtual std::ptrdiff_t read(std::uint8_t* bytes, std::size_t most) noexcept = 0;
  /// @}

  /// Waits until there are bytes to read, at most for this time. Only for the start.
  virtual void await(pulse::Nanoseconds timeout) = 0;

  /// For boards in virtual time: when the board does something. It is carried out by the next
  /// read().
  virtual pulse::Nanoseconds due() const { return pulse::kNever; }
};

}  // namespace stepdriver::klipper
