#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace stepdriver::klipper {

/// Integers of the protocol: groups of 7 bits, the highest one first, each but the last one with
/// its top bit set. One byte takes -32 to 95, two take -4096 to 12287, and so on; five take all
/// 32 bits, signed or not.
constexpr std::size_t kMostVlq = 5;

/// @param out has room for kMostVlq bytes. @return behind the last byte that was written.
std::uint8_t* putVlq(std::uint8_t* out, std::uint32_t value);

/// Takes an integer from the beginning of some bytes, and moves the beginning behind it.
/// @return empty: the bytes end within it, or it has more than kMostVlq.
std::optional<std::uint32_t> takeVlq(const std::uint8_t*& begin, const std::uint8_t* end);

}  // namespace stepdriver::klipper
