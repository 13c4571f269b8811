#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {

/// The SPI of a chip, which answers to a datagram of 40 bits with the next one, and what happens to
/// the bytes on it.
class SpiWire {
 public:
  /// The chip on it.
  struct Chip {
    std::function<bool()> has_power;
    std::function<std::uint8_t()> status;
    std::function<std::uint32_t(int number)> read;
    std::function<void(int number, std::uint32_t value)> write;
  };
  explicit SpiWire(Chip chip) : chip_(std::move(chip)) {}

  /// Only `flipped` matters: there is a clock for each bit.
  void setFaults(const WireFaults& faults) { faults_ = faults; }

  /// @return what the master hears meanwhile. Without power the line is low.
  std::vector<std::uint8_t> transfer(const std::uint8_t* bytes, std::size_t count);

 private:
  using Datagram = std::array<std::uint8_t, 5>;

  std::uint8_t carried(std::uint8_t byte);

  const Chip chip_;
  WireFaults faults_;
  std::uint32_t answer_ = 0;  // to the last datagram
  std::mt19937 random_{1};
};

}  // namespace stepdriver::sim
