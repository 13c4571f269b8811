#include "register_spi.h"

#include <utility>

namespace stepdriver::bus {
namespace {

constexpr std::uint8_t kSpiWrite = 0x80;
// IOIN, whose version is never all zeros or all ones: the chip is there.
constexpr std::uint8_t kProof = 0x04;
constexpr unsigned kProofShift = 24;

template <typename Datagram>
std::uint32_t dataOf(const Datagram& heard) {
  std::uint32_t value = 0;
  for (std::size_t i = 1; i < heard.size(); ++i) value = value << 8U | heard[i];
  return value;
}

}  // namespace

RegisterSpi::RegisterSpi(std::unique_ptr<SpiDevice> device) : device_(std::move(device)) {}

RegisterSpi::Datagram RegisterSpi::exchange(std::uint8_t first, std::uint32_t value) {
  const Datagram sent{first, static_cast<std::uint8_t>(value >> 24U),
                      static_cast<std::uint8_t>(value >> 16U),
                      static_cast<std::uint8_t>(value >> 8U), static_cast<std::uint8_t>(value)};
  Datagram heard{};
  device_->transfer(sent.data(), heard.data(), sent.size());
  return heard;
}

// The answer to what was sent last, which the chip has believed if it is there.
Failure RegisterSpi::takeAnswer(std::uint32_t& value) {
  value = dataOf(exchange(kProof, 0));
  const std::uint32_t version = dataOf(exchange(kProof, 0)) >> kProofShift;
  if (version == 0) return Failure::kAllZeros;
  return version == 0xFF ? Failure::kAllOnes : Failure::kNone;
}

Failure RegisterSpi::readOnce(std::uint8_t /*address*/, std::uint8_t number, std::uint32_t& value) {
  exchange(number, 0);
  return takeAnswer(value);
}

Failure RegisterSpi::write(std::uint8_t /*address*/, std::uint8_t number, std::uint32_t value) {
  Failure failure = Failure::kNone;
  for (int i = 0; i < kTries; ++i) {
    exchange(static_cast<std::uint8_t>(number | kSpiWrite), value);
    std::uint32_t taken = 0;
    failure = takeAnswer(taken);
    if (failure == Failure::kNone && taken == value) {
      ++transactions_;
      return failure;
    }
    ++retries_;
    if (failure == Failure::kNone) failure = Failure::kNotTaken;
  }
  return failure;
}

void RegisterSpi::writeUnchecked(std::uint8_t /*address*/, std::uint8_t number,
                                 std::uint32_t value) {
  exchange(static_cast<std::uint8_t>(number | kSpiWrite), value);
}

}  // namespace stepdriver::bus
