#include "register_uart.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "steady_now.h"
#include "uart_frame.h"

namespace stepdriver::bus {
namespace {

constexpr std::uint8_t kWriteCount = 0x02;  // IFCNT
// 1 start bit, 8 bits, 1 stop bit.
constexpr std::int64_t kBitsPerByte = 10;
// USB adapters hand over what they have received every 16 ms, and answers begin within 15 bytes
// (SENDDELAY).
constexpr std::int64_t kTurnNs = 25'000'000;
// After the last byte that was expected, a further one shows that the frame was another one.
constexpr std::int64_t kQuietBytes = 2;

}  // namespace

RegisterUart::RegisterUart(ByteStream& stream, int baud)
    : stream_(stream), byte_ns_(kBitsPerByte * 1'000'000'000 / baud) {}

RegisterUart::RegisterUart(std::unique_ptr<ByteStream> stream, int baud)
    : own_stream_(std::move(stream)),
      stream_(*own_stream_),
      byte_ns_(kBitsPerByte * 1'000'000'000 / baud) {}

RegisterUart::Heard RegisterUart::exchange(const std::uint8_t* bytes, std::size_t count,
                                           std::size_t expected) {
  Heard heard;
  // What is left from before belongs to no answer. There is an end to it even if another program
  // sends all the time.
  for (int i = 0; i < kTries && stream_.receive(heard.bytes.data(), heard.bytes.size(), 0) > 0;) {
    ++i;
  }
  stream_.send(bytes, count);
  const std::int64_t all_ns = static_cast<std::int64_t>(count + expected) * byte_ns_ + kTurnNs;
  const std::int64_t end = steadyNow() + all_ns;
  while (heard.count < heard.bytes.size()) {
    const bool complete = heard.count >= expected;
    const std::int64_t wait =
        complete ? kQuietBytes * byte_ns_ : std::max<std::int64_t>(end - steadyNow(), 0);
    const std::size_t more =
        stream_.receive(heard.bytes.data() + heard.count, heard.bytes.size() - heard.count, wait);
    if (more == 0) break;
    heard.count += more;
  }
  return heard;
}

Failure RegisterUart::readOnce(std::uint8_t address, std::uint8_t number, std::uint32_t& value) {
  const ReadRequest request = readRequest(address, number);
  constexpr std::size_t kEcho = request.size();
  constexpr std::size_t kAnswer = Answer().size();
  const Heard heard = exchange(request.data(), kEcho, kEcho + kAnswer);
  if (heard.count == 0) return Failure::kNothing;
  const bool echoed =
      heard.count >= kEcho && std::equal(request.begin(), request.end(), heard.bytes.begin());
  if (echoed && heard.count == kEcho) return Failure::kOnlyEcho;
  if (heard.count == kAnswer && valueOf(heard.bytes.data(), number)) return Failure::kNoEcho;
  if (!echoed || heard.count != kEcho + kAnswer) return Failure::kGarbled;
  const std::optional<std::uint32_t> answer = valueOf(heard.bytes.data() + kEcho, number);
  if (!answer) return Failure::kGarbled;
  value = *answer;
  return Failure::kNone;
}

Failure RegisterUart::write(std::uint8_t address, std::uint8_t number, std::uint32_t value) {
  const WriteFrame frame = writeFrame(address, number, value);
  for (int i = 0; i < kTries; ++i) {
    std::uint32_t before = 0;
    std::uint32_t after = 0;
    Failure failure = read(address, kWriteCount, 0, before);
    if (failure != Failure::kNone) return failure;
    const Heard heard = exchange(frame.data(), frame.size(), frame.size());
    failure = read(address, kWriteCount, 0, after);
    if (failure != Failure::kNone) return failure;
    const bool echoed =
        heard.count == frame.size() && std::equal(frame.begin(), frame.end(), heard.bytes.begin());
    const bool counted = ((before + 1) & 0xFFU) == (after & 0xFFU);
    if (echoed && counted) {
      ++transactions_;
      return Failure::kNone;
    }
    ++retries_;
    if (before != after) return Failure::kStray;
  }
  return Failure::kNotCounted;
}

void RegisterUart::writeUnchecked(std::uint8_t address, std::uint8_t number, std::uint32_t value) {
  const WriteFrame frame = writeFrame(address, number, value);
  exchange(frame.data(), frame.size(), frame.size());
}

}  // namespace stepdriver::bus
