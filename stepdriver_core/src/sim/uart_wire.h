#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {

/// The single wire of chips with a serial interface, and what happens to the bytes on it. All who
/// listen hear the same.
class UartWire {
 public:
  /// A chip on the wire.
  struct Chip {
    int address = 0;
    std::function<bool()> has_power;
    std::function<std::uint32_t(int number)> read;
    std::function<void(int number, std::uint32_t value)> write;
  };
  void add(Chip chip) { chips_.push_back(std::move(chip)); }

  void setFaults(const WireFaults& faults) { faults_ = faults; }

  /// The master sends bytes. @return what it hears: its own bytes and the answers.
  std::vector<std::uint8_t> send(const std::uint8_t* bytes, std::size_t count);
  /// The wire was idle for so long that a chip takes the next byte for the first of a frame.
  void pause() { begun_.clear(); }

 private:
  using Bytes = std::vector<std::uint8_t>;

  Bytes carried(const Bytes& bytes);
  Bytes answers(const Bytes& frame);
  bool happens(double probability);

  std::vector<Chip> chips_;
  WireFaults faults_;
  Bytes begun_;  // a frame that isn't complete
  Bytes late_;   // on its way to the port
  std::mt19937 random_{1};
};

}  // namespace stepdriver::sim
