#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "port/klipper/frame.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::klipper {

using pulse::kNever;
using pulse::Nanoseconds;
constexpr Nanoseconds kMillisecond = 1'000'000;

/// Carries commands to a board, each exactly once and in order, over a line that loses, changes or
/// delays bytes. Pure: bytes in, bytes out, and times.
///
///     transport.send(command, size);
///     transport.serve(now);                     // then write transport.out() to the line
///     transport.receive(bytes, count, now);     // what the line has brought, then:
///     while (const auto frame = transport.next(now)) hear(frame->content, frame->size);
///
/// Commands go into blocks of up to kMostContent bytes, numbered modulo 16; at most kMostBlocks are
/// under way. The board takes a block only if its number is the next one, and each of its frames
/// says which number that is. Blocks are repeated if the board asks for them, or if it doesn't
/// answer in time. Answers of the board are not repeated by it: a lost one must be asked for again.
class Transport {
 public:
  static constexpr std::size_t kMostBlocks = 12;

  /// What has happened on the line since the start.
  struct Figures {
    std::uint64_t blocks = 0;    ///< that were sent, without those that were repeated
    std::uint64_t repeated = 0;  ///< because the board asked for it
    std::uint64_t timeouts = 0;  ///< because the board didn't answer
    std::uint64_t dropped = 0;   ///< bytes received that belonged to no frame
    std::uint64_t bytes = 0;     ///< sent, with those that were repeated
    Nanoseconds round_trip = 0;  ///< smoothed
  };

  Transport();

  /// Asks the board for the number of the block that it expects. No block is sent before it has
  /// answered; it may have another host's numbers.
  void connect(Nanoseconds now);
  bool isConnected() const { return connected_; }

  /// Queues a command. @pre size is 1 to kMostContent.
  void send(const std::uint8_t* command, std::size_t size);

  /// Makes blocks of what was queued, and repeats what must be.
  void serve(Nanoseconds now);

  /// Bytes for the line. The caller removes what it has written.
  const std::vector<std::uint8_t>& out() const { return out_; }
  void written(std::size_t count);

  /// @return how many of the bytes it has taken; the others once next() is empty.
  std::size_t receive(const std::uint8_t* bytes, std::size_t count) {
    return reader_.add(bytes, count);
  }
  /// A frame with content, as the board has sent it; lost and changed ones are left out.
  std::optional<FrameReader::Frame> next(Nanoseconds now);

  /// When serve() must be called again if nothing is sent or received.
  Nanoseconds due() const;
  /// The time since which the board hasn't confirmed a block although one is under way; kNever:
  /// none is.
  Nanoseconds waitsSince() const { return acknowledged_ == sent_ ? kNever : waits_since_; }
  /// Nothing is queued or under way: the board has all commands.
  bool isIdle() const { return acknowledged_ == sent_ && head_ == queue_.size(); }
  /// Bytes of commands that are queued.
  std::size_t queued() const { return queue_.size() - head_; }
  Figures figures() const;

 private:
  struct Block {
    std::array<std::uint8_t, kMostFrame> frame{};
    std::size_t length = 0;
    Nanoseconds sent = 0;
    bool repeated = false;
  };

  void hear(const FrameReader::Frame& frame, Nanoseconds now);
  void acknowledge(std::uint64_t count, Nanoseconds now);
  void noteRoundTrip(Nanoseconds time);
  void fillBlock(Nanoseconds now);
  void makeBlock(const std::uint8_t* content, std::size_t size, Nanoseconds now);
  void repeatAll(Nanoseconds now);
  void append(const Block& block);
  Block& block(std::uint64_t number) { return blocks_[number % blocks_.size()]; }

  FrameReader reader_;
  std::array<Block, 16> blocks_;
  std::vector<std::uint8_t> queue_;  // each command after its length
  std::size_t head_ = 0;
  std::vector<std::uint8_t> out_;
  std::uint64_t acknowledged_ = 0;  // blocks before this number have arrived
  std::uint64_t sent_ = 0;          // the number of the next block
  std::uint64_t deaf_until_ = 0;    // requests to repeat are answered once until this has arrived
  bool connected_ = false;
  Nanoseconds waits_since_ = 0;
  Nanoseconds timeout_;
  Nanoseconds times_out_ = kNever;
  bool knows_round_trip_ = false;
  Nanoseconds round_trip_ = 0;
  Nanoseconds variation_ = 0;
  Figures figures_;
};

}  // namespace stepdriver::klipper
