#include "register_port.h"

#include <optional>

namespace stepdriver::bus {

std::string causeOf(Failure failure) {
  switch (failure) {
    case Failure::kNone:
      break;
    case Failure::kPort:
      return "its port fails";
    case Failure::kNothing:
      return "not even the bytes that were sent came back: the wire from RX to PDN_UART, or the "
             "resistor between TX and RX, is missing, or it is another port";
    case Failure::kOnlyEcho:
      return "no chip answers: it has no motor supply, or another address (MS1, MS2), or PDN_UART "
             "isn't connected, or it can't measure this baud rate";
    case Failure::kNoEcho:
      return "the bytes that were sent don't come back: connect RX to the wire, too";
    case Failure::kGarbled:
      return "the bytes that came back are damaged: another program or a console uses the port, "
             "two chips have the same address, or the wire picks up noise";
    case Failure::kUnsettled:
      return "each answer is another one: two chips have the same address, or the wire picks up "
             "noise";
    case Failure::kNotCounted:
      return "the chip doesn't count the writes: another master writes as well, or the wire picks "
             "up noise";
    case Failure::kStray:
      return "the chip has taken a write that was damaged on the wire";
    case Failure::kMismatch:
      return "a register has another value than was written: another master writes as well, or the "
             "chip is another one";
    case Failure::kAllZeros:
      return "it answers with zeros only: it has no supply, or its line SDO or its chip select "
             "isn't connected, or it isn't in SPI mode (SPI_MODE)";
    case Failure::kAllOnes:
      return "it answers with ones only: it has no supply, or its line SDO isn't connected";
    case Failure::kNotTaken:
      return "it has heard another value than was written: the lines SDI and SCK pick up noise, or "
             "are too long";
  }
  return "";
}

Failure RegisterPort::read(std::uint8_t address, std::uint8_t number, std::uint32_t volatile_bits,
                           std::uint32_t& value) {
  Failure failure = Failure::kNone;
  std::optional<std::uint32_t> agreed;  // except for what is volatile
  for (int i = 0; i < kTries; ++i) {
    std::uint32_t first = 0;
    std::uint32_t second = 0;
    failure = readOnce(address, number, first);
    if (failure == Failure::kNone) failure = readOnce(address, number, second);
    if (failure == Failure::kNone && first == second) {
      value = second;
      ++transactions_;
      return Failure::kNone;
    }
    ++retries_;
    if (failure != Failure::kNone) continue;
    failure = Failure::kUnsettled;
    if (((first ^ second) & ~volatile_bits) == 0) agreed = second;
  }
  if (!agreed) return failure;
  value = *agreed;
  ++transactions_;
  return Failure::kNone;
}

Failure RegisterPort::sample(std::uint8_t address, std::uint8_t number, std::uint32_t& value) {
  Failure failure = Failure::kNone;
  for (int i = 0; i < kTries; ++i) {
    failure = readOnce(address, number, value);
    if (failure == Failure::kNone) {
      ++transactions_;
      return failure;
    }
    ++retries_;
  }
  return failure;
}

}  // namespace stepdriver::bus
