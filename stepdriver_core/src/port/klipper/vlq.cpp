#include "port/klipper/vlq.h"

namespace stepdriver::klipper {
namespace {

// Whether a number needs more than this many groups: a byte takes -32 to 95, a quarter of its range
// below 0 and three quarters above.
bool needsMoreThan(int groups, std::int64_t value) {
  const std::int64_t quarter = std::int64_t{1} << (7 * groups - 2);
  return value >= 3 * quarter || value < -quarter;
}

}  // namespace

std::uint8_t* putVlq(std::uint8_t* out, std::uint32_t value) {
  const std::int64_t number = static_cast<std::int32_t>(value);
  for (int groups = 4; groups > 0; --groups) {
    if (!needsMoreThan(groups, number)) continue;
    *out++ = static_cast<std::uint8_t>(((value >> (7 * groups)) & 0x7FU) | 0x80U);
  }
  *out++ = static_cast<std::uint8_t>(value & 0x7FU);
  return out;
}

std::optional<std::uint32_t> takeVlq(const std::uint8_t*& begin, const std::uint8_t* end) {
  if (begin == end) return std::nullopt;
  const std::uint8_t* next = begin;
  std::uint32_t value = *next & 0x7FU;
  // The quarter at the top of the first group is negative.
  if ((value & 0x60U) == 0x60U) value |= ~std::uint32_t{0x1F};
  while ((*next & 0x80U) != 0) {
    ++next;
    if (next == end || next - begin == kMostVlq) return std::nullopt;
    value = (value << 7) | (*next & 0x7FU);
  }
  begin = next + 1;
  return value;
}

}  // namespace stepdriver::klipper
