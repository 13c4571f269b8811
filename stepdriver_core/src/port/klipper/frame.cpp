#include "port/klipper/frame.h"

#include <algorithm>
#include <cstring>

namespace stepdriver::klipper {
namespace {

constexpr std::uint8_t kEndMark = 0x7E;
constexpr std::uint8_t kDestination = 0x10;  // the upper half of each sequence byte

}  // namespace

std::uint16_t frameChecksum(const std::uint8_t* bytes, std::size_t count) {
  std::uint16_t crc = 0xFFFF;
  for (std::size_t i = 0; i < count; ++i) {
    auto x = static_cast<std::uint8_t>(bytes[i] ^ (crc & 0xFFU));
    x = static_cast<std::uint8_t>(x ^ (x << 4));
    const unsigned wide = x;
    crc = static_cast<std::uint16_t>(((wide << 8) | (crc >> 8)) ^ (wide >> 4) ^ (wide << 3));
  }
  return crc;
}

std::size_t makeFrame(std::uint8_t sequence, const std::uint8_t* content, std::size_t size,
                      std::uint8_t* out) {
  const std::size_t length = size + kLeastFrame;
  out[0] = static_cast<std::uint8_t>(length);
  out[1] = static_cast<std::uint8_t>(kDestination | (sequence & kSequenceMask));
  std::copy_n(content, size, out + 2);
  const std::uint16_t crc = frameChecksum(out, size + 2);
  out[size + 2] = static_cast<std::uint8_t>(crc >> 8);
  out[size + 3] = static_cast<std::uint8_t>(crc & 0xFFU);
  out[size + 4] = kEndMark;
  return length;
}

std::size_t FrameReader::add(const std::uint8_t* bytes, std::size_t count) {
  if (begin_ != 0) {
    std::memmove(bytes_.data(), bytes_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
  }
  const std::size_t taken = std::min(count, bytes_.size() - end_);
  std::copy_n(bytes, taken, bytes_.data() + end_);
  end_ += taken;
  return taken;
}

std::optional<FrameReader::Frame> FrameReader::next() {
  while (begin_ != end_) {
    const std::uint8_t* frame = bytes_.data() + begin_;
    const std::size_t length = frame[0];
    if (length < kLeastFrame || length > kMostFrame) {
      drop();
      continue;
    }
    if (end_ - begin_ < length) return std::nullopt;
    const auto crc = static_cast<std::uint16_t>((frame[length - 3] << 8) | frame[length - 2]);
    if (frame[length - 1] != kEndMark || (frame[1] & ~kSequenceMask) != kDestination ||
        crc != frameChecksum(frame, length - 3)) {
      drop();
      continue;
    }
    begin_ += length;
    return Frame{static_cast<std::uint8_t>(frame[1] & kSequenceMask), frame + 2,
                 length - kLeastFrame};
  }
  return std::nullopt;
}

void FrameReader::drop() {
  const std::uint8_t* first = bytes_.data() + begin_;
  const std::uint8_t* end = bytes_.data() + end_;
  const std::uint8_t* mark = std::find(first, end, kEndMark);
  const auto count = static_cast<std::size_t>((mark == end ? end : mark + 1) - first);
  begin_ += count;
  // Between two frames there may be end marks without a frame.
  if (count > 1 || mark == end) dropped_ += count;
}

}  // namespace stepdriver::klipper
