#include "uart_wire.h"

#include <algorithm>
#include <utility>

#include "bus/uart_frame.h"

namespace stepdriver::sim {

bool UartWire::happens(double probability) {
  return probability > 0.0 && std::uniform_real_distribution<>(0.0, 1.0)(random_) < probability;
}

UartWire::Bytes UartWire::carried(const Bytes& bytes) {
  Bytes heard;
  for (std::uint8_t byte : bytes) {
    if (happens(faults_.lost)) continue;
    if (happens(faults_.flipped)) byte ^= static_cast<std::uint8_t>(1U << random_() % 8);
    heard.push_back(byte);
    if (happens(faults_.doubled)) heard.push_back(byte);
  }
  return heard;
}

std::vector<std::uint8_t> UartWire::send(const std::uint8_t* bytes, std::size_t count) {
  const Bytes echo = carried({bytes, bytes + count});
  Bytes heard = std::exchange(late_, {});
  if (!faults_.no_echo) heard.insert(heard.end(), echo.begin(), echo.end());
  if (faults_.unmeasured_rate) return heard;
  begun_.insert(begun_.end(), echo.begin(), echo.end());
  while (begun_.size() >= 4) {
    if ((begun_.front() & 0xFU) != bus::kSync) {
      begun_.clear();  // it waits for a pause
      break;
    }
    const std::size_t length = (begun_[2] & bus::kWriteBit) != 0 ? 8 : 4;
    if (begun_.size() < length) break;
    const Bytes frame(begun_.begin(), begun_.begin() + static_cast<std::ptrdiff_t>(length));
    begun_.erase(begun_.begin(), begun_.begin() + static_cast<std::ptrdiff_t>(length));
    if (bus::crcOf(frame.data(), length - 1) != frame.back()) {
      begun_.clear();
      break;
    }
    const Bytes answer = carried(answers(frame));
    for (const std::uint8_t byte : answer) {
      const bool is_late = !late_.empty() || happens(faults_.late);
      (is_late ? late_ : heard).push_back(byte);
    }
  }
  return heard;
}

// Chips that answer at the same time pull the wire low together.
UartWire::Bytes UartWire::answers(const Bytes& frame) {
  const int number = frame[2] & 0x7F;
  Bytes all;
  for (Chip& chip : chips_) {
    if (chip.address != frame[1] || !chip.has_power()) continue;
    if (frame.size() == 8) {
      std::uint32_t value = 0;
      for (std::size_t i = 3; i < 7; ++i) value = value << 8U | frame[i];
      chip.write(number, value);
      continue;
    }
    const bus::Answer answer = bus::answerOf(static_cast<std::uint8_t>(number), chip.read(number));
    if (all.empty()) all.assign(answer.size(), 0xFF);
    for (std::size_t i = 0; i < answer.size(); ++i) all[i] &= answer.at(i);
  }
  return all;
}

}  // namespace stepdriver::sim
