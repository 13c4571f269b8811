#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <functional>
#include <string>

#include "bus/port_error.h"
#include "bus/serial_port.h"
#include "bus/spidev.h"

namespace stepdriver::bus {
namespace {

/// A file that nobody may open, and while it lives the rights of a user who isn't root.
class ForbiddenFile {
 public:
  ForbiddenFile() {
    const int file = mkstemp(path_.data());
    EXPECT_GE(file, 0);
    EXPECT_EQ(fchmod(file, 0), 0);
    ::close(file);
    if (was_root_) {
      EXPECT_EQ(seteuid(kNobody), 0);
    }
  }
  ~ForbiddenFile() {
    if (was_root_) {
      EXPECT_EQ(seteuid(0), 0);
    }
    ::unlink(path_.c_str());
  }
  ForbiddenFile(const ForbiddenFile&) = delete;
  ForbiddenFile& operator=(const ForbiddenFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  static constexpr uid_t kNobody = 65534;

  std::string path_ = "/tmp/stepdriver_port_XXXXXX";
  const bool was_root_ = geteuid() == 0;
};

std::string refusalOf(const std::function<void()>& open) {
  try {
    open();
  } catch (const PortError& error) {
    return error.what();
  }
  return "it was opened";
}

TEST(PortRights, NameTheGroupThatTheUserLacks) {
  const ForbiddenFile port;
  EXPECT_EQ(refusalOf([&] { SerialPort(port.path(), 115'200); }),
            "the serial port " + port.path() +
                " can't be opened: permission denied; add this user to the group dialout, and log "
                "in again");
  EXPECT_EQ(refusalOf([&] { Spidev(port.path(), 1'000'000); }),
            "the SPI device " + port.path() +
                " can't be opened: permission denied; add this user to the group spi, and log in "
                "again");
}

}  // namespace
}  // namespace stepdriver::bus
