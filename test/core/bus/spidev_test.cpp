#include "bus/spidev.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <filesystem>
#include <iterator>
#include <string>

#include "bus/port_error.h"

namespace stepdriver::bus {
namespace {

constexpr int kSpiRate = 1'000'000;

std::string whyNotOpened(const std::string& path) {
  try {
    const Spidev device(path, kSpiRate);
  } catch (const PortError& error) {
    return error.what();
  }
  return "it was opened";
}

std::ptrdiff_t openFiles() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"),
                       std::filesystem::directory_iterator());
}

TEST(SpidevTest, NamesADeviceThatIsMissing) {
  EXPECT_EQ(whyNotOpened("/dev/no_such_spidev"),
            "the SPI device /dev/no_such_spidev can't be opened: there is no such device; switch "
            "SPI on (on a Raspberry Pi, dtparam=spi=on in config.txt)");
}

TEST(SpidevTest, RefusesAnotherDeviceAndLeavesItClosed) {
  const std::ptrdiff_t before = openFiles();
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(whyNotOpened("/dev/null"),
              "the SPI device /dev/null can't be opened: it isn't an SPI device");
  }
  EXPECT_EQ(openFiles(), before);
}

}  // namespace
}  // namespace stepdriver::bus
