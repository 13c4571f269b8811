#include "serial_port.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "steady_now.h"

namespace stepdriver::bus {
namespace {

// The kernel takes a frame of 8 bytes at once, unless the port hangs.
constexpr std::int64_t kSendTimeoutNs = 200'000'000;

struct Rate {
  int baud;
  speed_t code;
};
constexpr std::array<Rate, 8> kRates{{{9600, B9600},
                                      {19200, B19200},
                                      {38400, B38400},
                                      {57600, B57600},
                                      {115200, B115200},
                                      {230400, B230400},
                                      {460800, B460800},
                                      {500000, B500000}}};

speed_t codeOf(int baud) {
  for (const Rate& rate : kRates) {
    if (rate.baud == baud) return rate.code;
  }
  return B115200;
}

std::string whyNotOpen(const std::string& path, int error) {
  const std::string begin = fmt::format("the serial port {} can't be opened: ", path);
  switch (error) {
    case ENOENT:
    case ENXIO:
    case ENODEV:
      return begin + "there is no such device; plug in the adapter, or switch the port on";
    case EACCES:
    case EPERM:
      return begin + "permission denied; add this user to the group dialout, and log in again";
    case EBUSY:
    case EWOULDBLOCK:
      return begin +
             "another program uses it; stop that program, or the console on this port "
             "(console=serial0 in cmdline.txt)";
    case ENOTTY:
      return begin + "it isn't a serial port";
    default:
      return begin + std::strerror(error);
  }
}

}  // namespace

SerialPort::SerialPort(std::string path, int baud) : path_(std::move(path)) {
  file_ = ::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (file_ < 0) throw PortError(whyNotOpen(path_, errno));
  try {
    if (isatty(file_) == 0) throw PortError(whyNotOpen(path_, ENOTTY));
    // flock() keeps out programs that ask for it, TIOCEXCL those that don't. The lock comes first:
    // without it, the exclusive mode may be that of another program.
    if (flock(file_, LOCK_EX | LOCK_NB) != 0) throw PortError(whyNotOpen(path_, errno));
    if (ioctl(file_, TIOCEXCL) != 0) throw PortError(whyNotOpen(path_, errno));
    setUp(baud);
  } catch (const PortError&) {
    ::close(file_);
    throw;
  }
}

SerialPort::~SerialPort() {
  ioctl(file_, TIOCNXCL);  // it would outlive this file if another one is open
  ::close(file_);
}

void SerialPort::setUp(int baud) const {
  termios settings{};
  if (tcgetattr(file_, &settings) != 0) throw PortError(whyNotOpen(path_, errno));
  cfmakeraw(&settings);
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 0;
  cfsetispeed(&settings, codeOf(baud));
  cfsetospeed(&settings, codeOf(baud));
  if (tcsetattr(file_, TCSANOW, &settings) != 0) throw PortError(whyNotOpen(path_, errno));
  // It succeeds if any of the settings could be made.
  termios made{};
  if (tcgetattr(file_, &made) != 0) throw PortError(whyNotOpen(path_, errno));
  if (cfgetospeed(&made) != codeOf(baud)) {
    throw PortError(fmt::format("the serial port {} has no rate of {} baud", path_, baud));
  }
  tcflush(file_, TCIOFLUSH);
}

void SerialPort::lost(const std::string& what) const {
  throw PortError(
      fmt::format("the serial port {} {}; check the adapter and its cable", path_, what));
}

bool SerialPort::await(short event, std::int64_t timeout_ns) const {
  const std::int64_t end = steadyNow() + timeout_ns;
  for (;;) {
    const std::int64_t left = end - steadyNow();
    pollfd waited{file_, event, 0};
    timespec time{};
    if (left > 0) {
      time.tv_sec = static_cast<time_t>(left / 1'000'000'000);
      time.tv_nsec = static_cast<long>(left % 1'000'000'000);
    }
    const int ready = ppoll(&waited, 1, &time, nullptr);
    if (ready < 0 && errno != EINTR) lost(std::string("fails: ") + std::strerror(errno));
    if (ready > 0 && (waited.revents & event) != 0) return true;
    if (ready > 0) lost("is gone");
    if (ready == 0 && left <= 0) return false;
  }
}

void SerialPort::send(const std::uint8_t* bytes, std::size_t count) {
  std::size_t sent = 0;
  while (sent < count) {
    if (!await(POLLOUT, kSendTimeoutNs)) lost("takes no bytes");
    const ssize_t written = ::write(file_, bytes + sent, count - sent);
    if (written >= 0) {
      sent += static_cast<std::size_t>(written);
    } else if (errno != EAGAIN && errno != EINTR) {
      lost(std::string("fails: ") + std::strerror(errno));
    }
  }
}

std::size_t SerialPort::receive(std::uint8_t* bytes, std::size_t most, std::int64_t timeout_ns) {
  if (!await(POLLIN, timeout_ns)) return 0;
  const ssize_t count = ::read(file_, bytes, most);
  if (count > 0) return static_cast<std::size_t>(count);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return 0;
  lost("is gone");
}

}  // namespace stepdriver::bus
