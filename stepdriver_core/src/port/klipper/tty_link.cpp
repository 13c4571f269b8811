#include "port/klipper/tty_link.h"

// Not termios.h: only these have rates such as 250000, and the two don't go together.
#include <asm/ioctls.h>
#include <asm/termbits.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>

#include "gpio/chip_table.h"
#include "port/klipper/dictionary.h"

extern "C" int ioctl(int file, unsigned long request, ...) noexcept;

namespace stepdriver::klipper {
namespace {

constexpr pulse::Nanoseconds kNsPerMs = 1'000'000;

std::string whyNotOpened(int error) {
  if (error == EACCES || error == EPERM) {
    return "permission denied: become a member of the group dialout (sudo usermod -aG dialout "
           "$USER), then log in again";
  }
  if (error == ENOENT) return "there is no such port: is the board plugged in?";
  return gpio::errorText(error);
}

}  // namespace

TtyLink::TtyLink(const std::string& board, const std::string& path, int baud)
    : file_(open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
  const auto refuse = [&](const std::string& why) {
    if (file_ >= 0) close(file_);
    throw BoardError(
        fmt::format("the port {} of the board {} can't be used: {}", path, board, why));
  };
  if (file_ < 0) refuse(whyNotOpened(errno));
  if (flock(file_, LOCK_EX | LOCK_NB) != 0) {
    refuse("another program uses it: stop that program (a printer's host, another node)");
  }
  termios2 settings{};
  if (ioctl(file_, TCGETS2, &settings) != 0) refuse("it is no serial port");
  settings.c_iflag = 0;
  settings.c_oflag = 0;
  settings.c_lflag = 0;
  settings.c_cflag = CS8 | CREAD | CLOCAL | BOTHER;
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 0;
  settings.c_ispeed = settings.c_ospeed = static_cast<unsigned>(baud);
  if (ioctl(file_, TCSETS2, &settings) != 0) {
    refuse(fmt::format("it doesn't have a rate of {}", baud));
  }
  ioctl(file_, TCFLSH, TCIOFLUSH);
}

TtyLink::~TtyLink() { close(file_); }

std::ptrdiff_t TtyLink::write(const std::uint8_t* bytes, std::size_t count) noexcept {
  const ssize_t written = ::write(file_, bytes, count);
  if (written >= 0) return written;
  return errno == EAGAIN || errno == EINTR ? 0 : -errno;
}

std::ptrdiff_t TtyLink::read(std::uint8_t* bytes, std::size_t most) noexcept {
  const ssize_t count = ::read(file_, bytes, most);
  if (count > 0) return count;
  if (count == 0) {
    // Nothing was there; or it is the end, which poll() knows.
    pollfd file{file_, POLLIN, 0};
    const bool hung_up = poll(&file, 1, 0) > 0 && (file.revents & (POLLHUP | POLLERR)) != 0;
    return hung_up ? -ENODEV : 0;
  }
  if (errno == EAGAIN || errno == EINTR) return 0;
  return errno == EIO ? -ENODEV : -errno;
}

void TtyLink::await(pulse::Nanoseconds timeout) {
  pollfd file{file_, POLLIN, 0};
  poll(&file, 1, static_cast<int>(timeout / kNsPerMs));
}

}  // namespace stepdriver::klipper
