#include "spidev.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/spi/spidev.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace stepdriver::bus {
namespace {

std::string whyNoSpi(const std::string& path, int error) {
  const std::string begin = fmt::format("the SPI device {} can't be opened: ", path);
  switch (error) {
    case ENOENT:
    case ENXIO:
    case ENODEV:
      return begin +
             "there is no such device; switch SPI on (on a Raspberry Pi, dtparam=spi=on in "
             "config.txt)";
    case EACCES:
    case EPERM:
      return begin + "permission denied; add this user to the group spi, and log in again";
    case EBUSY:
    case EWOULDBLOCK:
      return begin + "another program uses it; stop that program";
    case ENOTTY:
      return begin + "it isn't an SPI device";
    default:
      return begin + std::strerror(error);
  }
}

}  // namespace

Spidev::Spidev(std::string path, int rate) : path_(std::move(path)) {
  file_ = ::open(path_.c_str(), O_RDWR | O_CLOEXEC);
  if (file_ < 0) throw PortError(whyNoSpi(path_, errno));
  try {
    setUp(rate);
    if (flock(file_, LOCK_EX | LOCK_NB) != 0) throw PortError(whyNoSpi(path_, errno));
  } catch (const PortError&) {
    ::close(file_);
    throw;
  }
}

Spidev::~Spidev() { ::close(file_); }

void Spidev::setUp(int rate) const {
  std::uint8_t mode = SPI_MODE_3;
  std::uint8_t bits = 8;
  auto most = static_cast<std::uint32_t>(rate);
  if (ioctl(file_, SPI_IOC_WR_MODE, &mode) != 0) throw PortError(whyNoSpi(path_, errno));
  if (ioctl(file_, SPI_IOC_WR_BITS_PER_WORD, &bits) != 0 ||
      ioctl(file_, SPI_IOC_WR_MAX_SPEED_HZ, &most) != 0) {
    throw PortError(whyNoSpi(path_, errno));
  }
}

void Spidev::transfer(const std::uint8_t* sent, std::uint8_t* heard, std::size_t count) {
  spi_ioc_transfer transfer{};
  transfer.tx_buf = reinterpret_cast<std::uintptr_t>(sent);
  transfer.rx_buf = reinterpret_cast<std::uintptr_t>(heard);
  transfer.len = static_cast<std::uint32_t>(count);
  if (ioctl(file_, SPI_IOC_MESSAGE(1), &transfer) >= 0) return;
  throw PortError(
      fmt::format("the SPI device {} fails: {}; then call recover", path_, std::strerror(errno)));
}

}  // namespace stepdriver::bus
