#include "bus/spidev.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bus/open_port.h"
#include "kernel_bench.h"
#include "sim/spi_wire.h"
#include "sim/tmc_model.h"
#include "support/gpio_sim.h"

// The kernel's spidev on lines that its trace shows: `run.sh --spi`.

namespace stepdriver::kernel {
namespace {

constexpr const char* kDevice = "/dev/spidev0.0";
constexpr int kSpiRate = 1'000'000;
constexpr std::uint8_t kCurrents = 0x10;  // IHOLD_IRUN

/// A datagram as a chip in SPI mode 3 takes it.
struct Datagram {
  std::vector<std::uint8_t> bytes;
  int bits_left = 0;           ///< bits after the last whole byte
  bool clock_was_high = true;  ///< when the chip was selected
};

/// The chip takes a bit at each rising edge of the clock while its select line is low.
std::vector<Datagram> datagramsIn(const KernelTrace& trace) {
  const unsigned clock = trace.line("spi:0");
  const unsigned data = trace.line("spi:1");
  const unsigned select = trace.line("spi:3");
  std::vector<Datagram> all;
  bool clock_level = true;
  bool data_level = false;
  bool is_selected = false;
  unsigned byte = 0;
  for (const LineEvent& event : trace.events()) {
    if (event.read) continue;
    if (event.line == data) data_level = event.level;
    if (event.line == select && is_selected == event.level) {
      is_selected = !event.level;
      if (is_selected) all.push_back({{}, 0, clock_level});
    }
    if (event.line != clock || event.level == clock_level) continue;
    clock_level = event.level;
    if (!is_selected || !clock_level) continue;
    byte = (byte << 1U | (data_level ? 1U : 0U)) & 0xFFU;
    if (++all.back().bits_left < 8) continue;
    all.back().bytes.push_back(static_cast<std::uint8_t>(byte));
    all.back().bits_left = 0;
  }
  return all;
}

/// The rig's chip hears the datagrams of a trace.
class ListeningChip {
 public:
  void hear(const std::vector<Datagram>& datagrams) {
    for (const Datagram& datagram : datagrams)
      wire_.transfer(datagram.bytes.data(), datagram.bytes.size());
  }
  std::uint32_t written(int number) const { return chip_.written(number); }

 private:
  sim::TmcModel chip_{sim::TmcSpec{}};
  sim::SpiWire wire_{{[] { return true; }, [this] { return chip_.statusByte({}); },
                      [this](int number) { return chip_.read(number, {}); },
                      [this](int number, std::uint32_t value) { chip_.write(number, value); }}};
};

/// The device tree's chip isn't in configfs.
void driveLineFromDevice(bool level) {
  for (const auto& device : std::filesystem::directory_iterator("/sys/devices/platform")) {
    for (const char* const name : {"gpiochip0", "gpiochip1"}) {
      const auto pull = device.path() / name / "sim_gpio2" / "pull";
      if (std::filesystem::exists(pull))
        return test::writeText(pull, level ? "pull-up" : "pull-down");
    }
  }
  FAIL() << "there is no line from the device";
}

std::string messageOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const bus::PortError& error) {
    return error.what();
  }
  return "nothing failed";
}

class SpidevOnLines : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kDevice)) GTEST_SKIP() << "runs with an SPI bus (run.sh --spi)";
  }
};

TEST_F(SpidevOnLines, SendsWhatAChipUnderstands) {
  Recording recording;
  const auto registers = bus::openPort(kDevice, 0, {});
  registers->writeUnchecked(0, kCurrents, 0x00'01'1F'08);
  const std::vector<Datagram> sent = datagramsIn(recording.stop("spidev"));
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent.front().bytes, (std::vector<std::uint8_t>{0x90, 0x00, 0x01, 0x1F, 0x08}));
  EXPECT_EQ(sent.front().bits_left, 0);
  EXPECT_TRUE(sent.front().clock_was_high);
  ListeningChip chip;
  chip.hear(sent);
  EXPECT_EQ(chip.written(kCurrents), 0x00011F08U);
}

TEST_F(SpidevOnLines, BelievesNothingIfTheLineFromTheChipNeverChanges) {
  const auto registers = bus::openPort(kDevice, 0, {});
  for (const bool level : {false, true}) {
    driveLineFromDevice(level);
    std::uint32_t value = 0;
    EXPECT_EQ(registers->read(0, kCurrents, 0, value),
              level ? bus::Failure::kAllOnes : bus::Failure::kAllZeros);
    Recording recording;
    EXPECT_EQ(registers->write(0, kCurrents, 0x00'01'1F'08),
              level ? bus::Failure::kAllOnes : bus::Failure::kAllZeros);
    ListeningChip chip;
    chip.hear(datagramsIn(recording.stop("spidev")));
    EXPECT_EQ(chip.written(kCurrents), 0x00011F08U);
  }
  EXPECT_EQ(registers->transactions(), 0U);
}

TEST_F(SpidevOnLines, IsUsedByOneProgram) {
  const bus::Spidev first(kDevice, kSpiRate);
  EXPECT_EQ(messageOf([] { const bus::Spidev second(kDevice, kSpiRate); }),
            "the SPI device /dev/spidev0.0 can't be opened: another program uses it; stop that "
            "program");
}

TEST_F(SpidevOnLines, NamesADeviceThatFailsWhileItIsOpen) {
  const std::string driver = "/sys/bus/spi/drivers/spidev";
  const auto registers = bus::openPort(kDevice, 0, {});
  test::writeText(driver + "/unbind", "spi0.0");
  EXPECT_EQ(messageOf([&] { registers->writeUnchecked(0, kCurrents, 0); }),
            "the SPI device /dev/spidev0.0 fails: Cannot send after transport endpoint shutdown; "
            "then call recover");
  EXPECT_EQ(messageOf([] { const bus::Spidev device(kDevice, kSpiRate); }),
            "the SPI device /dev/spidev0.0 can't be opened: there is no such device; switch SPI on "
            "(on a Raspberry Pi, dtparam=spi=on in config.txt)");
  test::writeText(driver + "/bind", "spi0.0");
  EXPECT_EQ(messageOf([] { const bus::Spidev device(kDevice, kSpiRate); }), "nothing failed");
}

}  // namespace
}  // namespace stepdriver::kernel
