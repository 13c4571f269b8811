#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace stepdriver::sim {

/// A board's end of the line, by the description of Klipper's protocol: frames with a length, a
/// sequence number and a checksum. It has nothing in common with the host's end, so that a mistake
/// of one isn't that of the other too.
class BoardWire {
 public:
  using Bytes = std::vector<std::uint8_t>;

  /// Bytes from the host. @return the contents of the blocks that are complete, right and in order.
  /// Everything else is answered by a request to repeat.
  std::vector<Bytes> receive(const std::uint8_t* bytes, std::size_t count);
  /// Sends a frame with this content.
  void send(const Bytes& content);
  /// Confirms the blocks until now.
  void acknowledge() { send({}); }

  Bytes take();
  bool hasBytes() const { return !out_.empty(); }
  /// The number of the block that is expected, as after a reset: 0.
  void reset();
  /// Another host was here before.
  void expect(std::uint8_t sequence) { expected_ = sequence & 0x0FU; }

 private:
  Bytes in_;
  Bytes out_;
  std::uint8_t expected_ = 0;
  bool synchronized_ = true;
};

/// Integers of that protocol, one after the other.
class BoardReader {
 public:
  explicit BoardReader(const BoardWire::Bytes& bytes) : bytes_(bytes) {}
  bool isAtEnd() const { return at_ >= bytes_.size(); }
  std::uint32_t next();

 private:
  const BoardWire::Bytes& bytes_;
  std::size_t at_ = 0;
};

void addInteger(BoardWire::Bytes& bytes, std::uint32_t value);

}  // namespace stepdriver::sim
