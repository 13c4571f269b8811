#include "bus/register_spi.h"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <utility>

#include "sim/spi_wire.h"
#include "sim/tmc_model.h"

namespace stepdriver::bus {
namespace {

constexpr std::uint8_t kModes = 0x00;     // GCONF
constexpr std::uint8_t kCurrents = 0x10;  // IHOLD_IRUN
constexpr std::uint8_t kChopper = 0x6C;   // CHOPCONF

/// A chip of the rig that is always at rest, on a wire of its own.
struct WiredSpi {
  explicit WiredSpi(int version = 0x30) : chip(specOf(version)), wire(wired()) {}

  static sim::TmcSpec specOf(int version) {
    sim::TmcSpec spec;
    spec.version = version;
    return spec;
  }
  sim::SpiWire::Chip wired() {
    sim::SpiWire::Chip all;
    all.has_power = [this] { return chip.spec().has_power; };
    all.status = [this] { return chip.statusByte({}); };
    all.read = [this](int number) { return chip.read(number, {}); };
    all.write = [this](int number, std::uint32_t value) { chip.write(number, value); };
    return all;
  }
  std::unique_ptr<SpiDevice> device();

  sim::TmcModel chip;
  sim::SpiWire wire;
  std::optional<std::uint8_t> stuck;  ///< all bytes that are heard
};

class WiredDevice : public SpiDevice {
 public:
  explicit WiredDevice(WiredSpi& spi) : spi_(spi) {}
  void transfer(const std::uint8_t* sent, std::uint8_t* heard, std::size_t count) override {
    const auto bytes = spi_.wire.transfer(sent, count);
    for (std::size_t i = 0; i < count; ++i) heard[i] = spi_.stuck.value_or(bytes[i]);
  }

 private:
  WiredSpi& spi_;
};

std::unique_ptr<SpiDevice> WiredSpi::device() { return std::make_unique<WiredDevice>(*this); }

TEST(RegisterSpi, ReadsAndWrites) {
  for (const int version : {0x11, 0x30}) {
    WiredSpi spi(version);
    RegisterSpi registers(spi.device());
    ASSERT_EQ(registers.write(0, kChopper, 0x140100C3), Failure::kNone);
    EXPECT_EQ(spi.chip.written(kChopper), 0x140100C3U);
    ASSERT_EQ(registers.write(0, kCurrents, 0x00011F08), Failure::kNone);
    EXPECT_EQ(spi.chip.written(kCurrents), 0x00011F08U);
    std::uint32_t value = 0;
    ASSERT_EQ(registers.read(0, kChopper, 0, value), Failure::kNone);
    EXPECT_EQ(value, 0x140100C3U);
    ASSERT_EQ(registers.read(0, 0x04, 0, value), Failure::kNone);
    EXPECT_EQ(value >> 24U, static_cast<std::uint32_t>(version));
    EXPECT_EQ(registers.retries(), 0U);
  }
}

// A value of 0 is believed, and silence isn't.
TEST(RegisterSpi, TellsCausesApart) {
  WiredSpi spi;
  RegisterSpi registers(spi.device());
  std::uint32_t value = 1;
  EXPECT_EQ(registers.read(0, kModes, 0, value), Failure::kNone);
  EXPECT_EQ(value, 0U);
  spi.stuck = 0x00;
  EXPECT_EQ(registers.read(0, kModes, 0, value), Failure::kAllZeros);
  EXPECT_EQ(registers.write(0, kModes, 0), Failure::kAllZeros);
  spi.stuck = 0xFF;
  EXPECT_EQ(registers.read(0, kModes, 0, value), Failure::kAllOnes);
  EXPECT_EQ(registers.write(0, kModes, 0xFFFFFFFF), Failure::kAllOnes);
  spi.stuck.reset();
  spi.chip.setPower(false);
  EXPECT_EQ(registers.sample(0, kModes, value), Failure::kAllZeros);
  spi.chip.setPower(true);
  sim::WireFaults noise;
  noise.flipped = 1.0;
  spi.wire.setFaults(noise);
  EXPECT_NE(registers.write(0, kModes, 4), Failure::kNone);
  EXPECT_EQ(registers.retries(), 18U);
}

// Bits are flipped in both directions: a value that is believed is the chip's, and what a register
// says when it is read back after a write that is believed is what was written.
TEST(RegisterSpi, BelievesNoWrongValueInNoise) {
  constexpr int kTransactions = 100'000;
  constexpr std::array<std::uint8_t, 2> kReadable{kModes, kChopper};
  WiredSpi spi;
  RegisterSpi registers(spi.device());
  sim::WireFaults noise;
  noise.flipped = 0.002;
  spi.wire.setFaults(noise);
  std::mt19937 random(7);
  int believed = 0;
  for (int i = 0; i < kTransactions; ++i) {
    const std::uint8_t number = kReadable.at(random() % kReadable.size());
    std::uint32_t value = 0;
    if (random() % 2 == 0) {
      if (registers.read(0, number, 0, value) != Failure::kNone) continue;
      ++believed;
      ASSERT_EQ(value, spi.chip.written(number)) << "read " << i;
      continue;
    }
    const auto wanted = static_cast<std::uint32_t>(random());
    if (registers.write(0, number, wanted) != Failure::kNone) continue;
    if (registers.read(0, number, 0, value) != Failure::kNone || value != wanted) continue;
    ++believed;
    ASSERT_EQ(spi.chip.written(number), wanted) << "write " << i;
  }
  EXPECT_GT(believed, kTransactions / 2);
  EXPECT_GT(registers.retries(), 0U);
}

}  // namespace
}  // namespace stepdriver::bus
