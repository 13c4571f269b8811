#include "port/klipper/transport.h"

#include <algorithm>
#include <cstdlib>

namespace stepdriver::klipper {
namespace {

// A board answers within a millisecond, a USB bus and a busy computer within some more. The timeout
// doubles each time, as on any line that may be overloaded.
constexpr Nanoseconds kShortestTimeout = 5'000'000;
constexpr Nanoseconds kFirstTimeout = 50'000'000;
constexpr Nanoseconds kLongestTimeout = 400'000'000;
// So much fits that no command is queued without room in practice: a second of a fast link.
constexpr std::size_t kReserved = 1 << 18;

}  // namespace

Transport::Transport() : timeout_(kFirstTimeout) {
  queue_.reserve(kReserved);
  out_.reserve(kMostBlocks * kMostFrame * 4);
}

void Transport::connect(Nanoseconds now) {
  connected_ = false;
  // A block without content does nothing, whether the board takes it or not: its answer has the
  // number either way.
  Block question;
  question.length = makeFrame(0, nullptr, 0, question.frame.data());
  append(question);
  times_out_ = now + timeout_;
}

void Transport::send(const std::uint8_t* command, std::size_t size) {
  if (head_ == queue_.size()) {
    queue_.clear();
    head_ = 0;
  } else if (head_ > kReserved / 2) {
    queue_.erase(queue_.begin(), queue_.begin() + static_cast<std::ptrdiff_t>(head_));
    head_ = 0;
  }
  queue_.push_back(static_cast<std::uint8_t>(size));
  queue_.insert(queue_.end(), command, command + size);
}

void Transport::serve(Nanoseconds now) {
  if (now >= times_out_) {
    ++figures_.timeouts;
    timeout_ = std::min(2 * timeout_, kLongestTimeout);
    if (connected_) {
      repeatAll(now);
    } else {
      connect(now);
    }
  }
  if (!connected_) return;
  while (head_ != queue_.size() && sent_ - acknowledged_ < kMostBlocks) fillBlock(now);
}

void Transport::fillBlock(Nanoseconds now) {
  std::array<std::uint8_t, kMostContent> content{};
  std::size_t size = 0;
  while (head_ != queue_.size() && size + queue_[head_] <= content.size()) {
    const std::size_t command = queue_[head_];
    std::copy_n(queue_.data() + head_ + 1, command, content.data() + size);
    size += command;
    head_ += command + 1;
  }
  makeBlock(content.data(), size, now);
}

void Transport::makeBlock(const std::uint8_t* content, std::size_t size, Nanoseconds now) {
  if (acknowledged_ == sent_) waits_since_ = now;
  Block& made = block(sent_);
  made.length =
      makeFrame(static_cast<std::uint8_t>(sent_ & kSequenceMask), content, size, made.frame.data());
  made.sent = now;
  made.repeated = false;
  if (acknowledged_ == sent_) times_out_ = now + timeout_;
  ++sent_;
  ++figures_.blocks;
  append(made);
}

void Transport::append(const Block& block) {
  out_.insert(out_.end(), block.frame.data(), block.frame.data() + block.length);
  figures_.bytes += block.length;
}

void Transport::written(std::size_t count) {
  out_.erase(out_.begin(), out_.begin() + static_cast<std::ptrdiff_t>(count));
}

std::optional<FrameReader::Frame> Transport::next(Nanoseconds now) {
  while (const auto frame = reader_.next()) {
    hear(*frame, now);
    if (frame->size != 0) return frame;
  }
  return std::nullopt;
}

void Transport::hear(const FrameReader::Frame& frame, Nanoseconds now) {
  if (!connected_) {
    connected_ = true;
    acknowledged_ = sent_ = deaf_until_ = frame.sequence;
    times_out_ = kNever;
    timeout_ = kFirstTimeout;
    // The frame may have been an old one, and the board expects the number behind it if it has
    // taken the question: a block without content makes it that one in both cases.
    return makeBlock(nullptr, 0, now);
  }
  const std::uint64_t confirmed = (frame.sequence - acknowledged_) & kSequenceMask;
  // A larger number is that of a frame from before.
  if (confirmed > sent_ - acknowledged_) return;
  if (confirmed != 0) return acknowledge(confirmed, now);
  // Without content, and nothing new: the board asks for what is under way.
  if (frame.size != 0 || acknowledged_ == sent_ || acknowledged_ < deaf_until_) return;
  ++figures_.repeated;
  repeatAll(now);
}

void Transport::acknowledge(std::uint64_t count, Nanoseconds now) {
  const Block& last = block(acknowledged_ + count - 1);
  if (!last.repeated) noteRoundTrip(now - last.sent);
  // The line works: what was doubled for the blocks before isn't right for the next ones.
  if (knows_round_trip_) {
    timeout_ = std::clamp(round_trip_ + 4 * variation_, kShortestTimeout, kLongestTimeout);
  }
  acknowledged_ += count;
  waits_since_ = now;
  times_out_ = acknowledged_ == sent_ ? kNever : now + timeout_;
}

void Transport::noteRoundTrip(Nanoseconds time) {
  // Jacobson and Karels, as TCP does: the mean, and four times the mean deviation.
  if (!knows_round_trip_) {
    knows_round_trip_ = true;
    round_trip_ = time;
    variation_ = time / 2;
  } else {
    variation_ += (std::abs(time - round_trip_) - variation_) / 4;
    round_trip_ += (time - round_trip_) / 8;
  }
}

void Transport::repeatAll(Nanoseconds now) {
  for (std::uint64_t number = acknowledged_; number != sent_; ++number) {
    block(number).repeated = true;
    append(block(number));
  }
  deaf_until_ = sent_;
  times_out_ = now + timeout_;
}

Nanoseconds Transport::due() const {
  return connected_ && head_ != queue_.size() && sent_ - acknowledged_ < kMostBlocks ? 0
                                                                                     : times_out_;
}

Transport::Figures Transport::figures() const {
  Figures figures = figures_;
  figures.dropped = reader_.dropped();
  figures.round_trip = round_trip_;
  return figures;
}

}  // namespace stepdriver::klipper
