#include "spi_wire.h"

namespace stepdriver::sim {

std::uint8_t SpiWire::carried(std::uint8_t byte) {
  const bool is_flipped = faults_.flipped > 0.0 &&
                          std::uniform_real_distribution<>(0.0, 1.0)(random_) < faults_.flipped;
  return is_flipped ? static_cast<std::uint8_t>(byte ^ 1U << random_() % 8) : byte;
}

// A datagram of another length is none.
std::vector<std::uint8_t> SpiWire::transfer(const std::uint8_t* bytes, std::size_t count) {
  std::vector<std::uint8_t> heard(count);
  if (!chip_.has_power() || count != Datagram().size()) return heard;
  heard[0] = carried(chip_.status());
  std::uint32_t value = 0;
  for (std::size_t i = 1; i < count; ++i) {
    heard[i] = carried(static_cast<std::uint8_t>(answer_ >> 8U * (count - 1 - i)));
    value = value << 8U | carried(bytes[i]);
  }
  const std::uint8_t first = carried(bytes[0]);
  const int number = first & 0x7F;
  if ((first & 0x80U) != 0) {
    chip_.write(number, value);
    answer_ = value;
  } else {
    answer_ = chip_.read(number);
  }
  return heard;
}

}  // namespace stepdriver::sim
