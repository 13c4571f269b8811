#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace stepdriver::klipper {

/// Frames of the protocol: length, sequence number, content, checksum, end mark.
///
///     FrameReader reader;
///     reader.add(bytes, count);
///     while (const auto frame = reader.next()) hear(*frame);
constexpr std::size_t kLeastFrame = 5;
constexpr std::size_t kMostFrame = 64;
constexpr std::size_t kMostContent = kMostFrame - kLeastFrame;
constexpr std::uint8_t kSequenceMask = 0x0F;

/// The checksum of a frame, over everything before it.
std::uint16_t frameChecksum(const std::uint8_t* bytes, std::size_t count);

/// @param out has room for kMostFrame bytes. @pre size <= kMostContent. @return the frame's length.
std::size_t makeFrame(std::uint8_t sequence, const std::uint8_t* content, std::size_t size,
                      std::uint8_t* out);

/// Finds the frames in a stream of bytes. What is no frame is dropped, up to the next end mark.
class FrameReader {
 public:
  struct Frame {
    std::uint8_t sequence = 0;              ///< 0 to 15
    const std::uint8_t* content = nullptr;  ///< valid until the next call of the reader
    std::size_t size = 0;
  };

  /// @return how many of these bytes it has taken. The others have room once next() is empty.
  std::size_t add(const std::uint8_t* bytes, std::size_t count);
  std::optional<Frame> next();

  /// Bytes that belonged to no frame.
  std::uint64_t dropped() const { return dropped_; }

 private:
  void drop();

  std::array<std::uint8_t, 16 * kMostFrame> bytes_{};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace stepdriver::klipper
