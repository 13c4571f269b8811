#include "simulated_port.h"

#include <algorithm>

namespace stepdriver::bus {
namespace {

// Longer than any answer takes, and shorter than a program waits for one.
constexpr std::int64_t kPauseNs = 5'000'000;

}  // namespace

void SimulatedPort::send(const std::uint8_t* bytes, std::size_t count) {
  const auto heard = exchange_(bytes, count, std::exchange(pauses_, false));
  heard_.insert(heard_.end(), heard.begin(), heard.end());
}

std::size_t SimulatedPort::receive(std::uint8_t* bytes, std::size_t most, std::int64_t timeout_ns) {
  const std::size_t count = std::min(most, heard_.size());
  std::copy_n(heard_.begin(), count, bytes);
  heard_.erase(heard_.begin(), heard_.begin() + static_cast<std::ptrdiff_t>(count));
  pauses_ = pauses_ || (count == 0 && timeout_ns >= kPauseNs);
  return count;
}

void SimulatedSpi::transfer(const std::uint8_t* sent, std::uint8_t* heard, std::size_t count) {
  const auto bytes = exchange_(sent, count, true);
  std::copy_n(bytes.begin(), std::min(bytes.size(), count), heard);
}

}  // namespace stepdriver::bus
