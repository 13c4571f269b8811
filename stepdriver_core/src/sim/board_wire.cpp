#include "board_wire.h"

#include <algorithm>

namespace stepdriver::sim {
namespace {

constexpr std::uint8_t kEnd = 0x7E;

// CRC-16 of CCITT with reflected bits: polynomial 1021h, which is 8408h then, and a start of FFFFh,
// bit by bit.
std::uint16_t crcOf(const std::uint8_t* bytes, std::size_t count) {
  unsigned crc = 0xFFFF;
  for (std::size_t i = 0; i < count; ++i) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0x8408U : 0U);
  }
  return static_cast<std::uint16_t>(crc);
}

}  // namespace

std::vector<BoardWire::Bytes> BoardWire::receive(const std::uint8_t* bytes, std::size_t count) {
  in_.insert(in_.end(), bytes, bytes + count);
  std::vector<Bytes> blocks;
  for (;;) {
    if (!synchronized_) {
      const auto mark = std::find(in_.begin(), in_.end(), kEnd);
      if (mark == in_.end()) {
        in_.clear();
        break;
      }
      in_.erase(in_.begin(), mark + 1);
      synchronized_ = true;
      acknowledge();
    }
    if (in_.empty()) break;
    const std::size_t length = in_[0];
    if (length == kEnd) {
      in_.erase(in_.begin());
      continue;
    }
    if (length < 5 || length > 64 || (in_.size() > 1 && (in_[1] & 0xF0U) != 0x10U)) {
      synchronized_ = false;
      continue;
    }
    if (in_.size() < length) break;
    const unsigned crc = (unsigned{in_[length - 3]} << 8) | in_[length - 2];
    if (in_[length - 1] != kEnd || crc != crcOf(in_.data(), length - 3)) {
      synchronized_ = false;
      continue;
    }
    const bool is_next = (in_[1] & 0x0FU) == expected_;
    if (is_next) {
      expected_ = (expected_ + 1U) & 0x0FU;
      blocks.emplace_back(in_.begin() + 2, in_.begin() + static_cast<std::ptrdiff_t>(length) - 3);
    } else {
      acknowledge();
    }
    in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(length));
  }
  return blocks;
}

void BoardWire::send(const Bytes& content) {
  Bytes frame{static_cast<std::uint8_t>(content.size() + 5),
              static_cast<std::uint8_t>(0x10U | expected_)};
  frame.insert(frame.end(), content.begin(), content.end());
  const std::uint16_t crc = crcOf(frame.data(), frame.size());
  frame.push_back(static_cast<std::uint8_t>(crc >> 8));
  frame.push_back(static_cast<std::uint8_t>(crc & 0xFFU));
  frame.push_back(kEnd);
  out_.insert(out_.end(), frame.begin(), frame.end());
}

BoardWire::Bytes BoardWire::take() {
  Bytes bytes;
  bytes.swap(out_);
  return bytes;
}

void BoardWire::reset() {
  in_.clear();
  out_.clear();
  expected_ = 0;
  synchronized_ = true;
}

std::uint32_t BoardReader::next() {
  if (isAtEnd()) return 0;
  std::uint32_t group = bytes_[at_++];
  std::uint32_t value = group & 0x7FU;
  if ((group & 0x60U) == 0x60U) value -= 0x80U;
  while ((group & 0x80U) != 0 && !isAtEnd()) {
    group = bytes_[at_++];
    value = value * 128U + (group & 0x7FU);
  }
  return value;
}

void addInteger(BoardWire::Bytes& bytes, std::uint32_t value) {
  const auto number = static_cast<std::int32_t>(value);
  int groups = 1;
  std::int64_t limit = 32;
  while (groups < 5 && (number < -limit || number >= 3 * limit)) {
    limit *= 128;
    ++groups;
  }
  while (--groups > 0) {
    bytes.push_back(static_cast<std::uint8_t>(0x80U | ((value >> (7 * groups)) & 0x7FU)));
  }
  bytes.push_back(static_cast<std::uint8_t>(value & 0x7FU));
}

}  // namespace stepdriver::sim
