#include "uart_frame.h"

#include <algorithm>

namespace stepdriver::bus {
namespace {

constexpr std::uint8_t kPolynomial = 0x07;

/// The bytes of a register, the high one first, and the CRC behind them.
std::array<std::uint8_t, 8> completed(std::array<std::uint8_t, 8> frame, std::uint32_t value) {
  for (std::size_t i = 0; i < 4; ++i) {
    frame.at(3 + i) = static_cast<std::uint8_t>(value >> (24 - 8 * i));
  }
  frame.back() = crcOf(frame.data(), frame.size() - 1);
  return frame;
}

}  // namespace

std::uint8_t crcOf(const std::uint8_t* bytes, std::size_t count) {
  std::uint8_t crc = 0;
  for (std::size_t i = 0; i < count; ++i) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      const bool differs = ((crc >> 7U) ^ (bytes[i] >> bit)) & 1U;
      crc = static_cast<std::uint8_t>(crc << 1U);
      if (differs) crc ^= kPolynomial;
    }
  }
  return crc;
}

ReadRequest readRequest(std::uint8_t address, std::uint8_t number) {
  ReadRequest request{kSync, address, number, 0};
  request.back() = crcOf(request.data(), request.size() - 1);
  return request;
}

WriteFrame writeFrame(std::uint8_t address, std::uint8_t number, std::uint32_t value) {
  return completed({kSync, address, static_cast<std::uint8_t>(number | kWriteBit)}, value);
}

Answer answerOf(std::uint8_t number, std::uint32_t value) {
  return completed({kSync, kMaster, number}, value);
}

std::optional<std::uint32_t> valueOf(const std::uint8_t* bytes, std::uint8_t number) {
  std::uint32_t value = 0;
  for (std::size_t i = 3; i < 7; ++i) value = value << 8U | bytes[i];
  const Answer expected = answerOf(number, value);
  if (!std::equal(expected.begin(), expected.end(), bytes)) return {};
  return value;
}

}  // namespace stepdriver::bus
