#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>

#include "bus/byte_stream.h"
#include "sim/tmc_model.h"
#include "sim/uart_wire.h"

namespace stepdriver::test {

/// The rig's wire with chips on it, without a terminal between: what isn't there at once never
/// comes.
class WiredStream : public bus::ByteStream {
 public:
  /// A chip that is always at rest.
  sim::TmcModel& add(int address, int version = 0x21) {
    sim::TmcSpec spec;
    spec.address = address;
    spec.version = version;
    sim::TmcModel& chip = chips_.emplace(chips_.size(), sim::TmcModel(spec)).first->second;
    sim::UartWire::Chip wired;
    wired.address = address;
    wired.has_power = [&chip] { return chip.spec().has_power; };
    wired.read = [&chip](int number) { return chip.read(number, {}); };
    wired.write = [&chip](int number, std::uint32_t value) { chip.write(number, value); };
    wire.add(wired);
    return chip;
  }

  void send(const std::uint8_t* bytes, std::size_t count) override {
    wire.pause();
    const auto heard = wire.send(bytes, count);
    if (!is_cut) heard_.insert(heard_.end(), heard.begin(), heard.end());
  }
  std::size_t receive(std::uint8_t* bytes, std::size_t most, std::int64_t /*timeout_ns*/) override {
    const std::size_t count = std::min(most, heard_.size());
    for (std::size_t i = 0; i < count; ++i) {
      bytes[i] = heard_.front();
      heard_.pop_front();
    }
    return count;
  }
  /// Bytes of another program on the port.
  void hear(std::uint8_t byte) { heard_.push_back(byte); }

  sim::UartWire wire;
  bool is_cut = false;  ///< nothing comes back

 private:
  std::map<std::size_t, sim::TmcModel> chips_;
  std::deque<std::uint8_t> heard_;
};

}  // namespace stepdriver::test
