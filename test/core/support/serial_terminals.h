#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <pthread.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "start_thread.h"
#include "steady_now.h"
#include "stepdriver_core/error.h"

namespace stepdriver::test {

/// Pseudo terminals in place of serial ports: what a program writes to one goes to a listener, and
/// the program reads what the listener returns.
class SerialTerminals {
 public:
  /// @param pause the wire was idle since the last bytes.
  using Listener = std::function<std::vector<std::uint8_t>(
      const std::string& port, const std::uint8_t* bytes, std::size_t count, bool pause)>;

  /// @throw Error if the system has no pseudo terminal left.
  SerialTerminals(const std::vector<std::string>& ports, Listener listener);
  ~SerialTerminals();
  SerialTerminals(const SerialTerminals&) = delete;
  SerialTerminals& operator=(const SerialTerminals&) = delete;

  /// The path of the terminal of a port; the port itself if it has none.
  std::string pathOf(const std::string& port) const;

 private:
  struct Terminal {
    int master = -1;
    int kept = -1;  // keeps the terminal alive between two programs
    std::string path;
    std::int64_t last_ns = 0;  // of the bytes that came last
  };

  void add(const std::string& port);
  void close();
  void run();
  void serve(const std::string& port, Terminal& terminal);

  std::map<std::string, Terminal> terminals_;
  const Listener listener_;
  int ending_[2] = {-1, -1};  // a pipe
  std::thread thread_;
};

// A program that waits for an answer is silent for longer; the bytes of one frame come at once.
constexpr std::int64_t kSilenceNs = 5'000'000;

[[noreturn]] inline void noTerminal(const char* what) {
  throw Error(fmt::format("there is no pseudo terminal: {}: {}", what, std::strerror(errno)));
}

inline SerialTerminals::SerialTerminals(const std::vector<std::string>& ports, Listener listener)
    : listener_(std::move(listener)) {
  try {
    if (pipe2(ending_, O_CLOEXEC) != 0) noTerminal("pipe");
    for (const std::string& port : ports) add(port);
    thread_ = startThread([this] { run(); });
  } catch (const Error&) {
    close();
    throw;
  }
}

inline SerialTerminals::~SerialTerminals() {
  const char end = 0;
  while (::write(ending_[1], &end, 1) < 0 && errno == EINTR) {
  }
  thread_.join();
  close();
}

inline void SerialTerminals::close() {
  for (auto& [port, terminal] : terminals_) {
    if (terminal.kept >= 0) ::close(terminal.kept);
    if (terminal.master >= 0) ::close(terminal.master);
  }
  for (const int file : ending_) {
    if (file >= 0) ::close(file);
  }
}

inline void SerialTerminals::add(const std::string& port) {
  Terminal& terminal = terminals_[port];
  if (terminal.master >= 0) return;
  terminal.master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (terminal.master < 0) noTerminal("posix_openpt");
  std::array<char, 128> path{};
  if (grantpt(terminal.master) != 0 || unlockpt(terminal.master) != 0 ||
      ptsname_r(terminal.master, path.data(), path.size()) != 0) {
    noTerminal("ptsname");
  }
  terminal.path = path.data();
  terminal.kept = ::open(path.data(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (terminal.kept < 0) noTerminal("open");
  termios settings{};
  if (tcgetattr(terminal.kept, &settings) != 0) noTerminal("tcgetattr");
  cfmakeraw(&settings);
  if (tcsetattr(terminal.kept, TCSANOW, &settings) != 0) noTerminal("tcsetattr");
}

inline std::string SerialTerminals::pathOf(const std::string& port) const {
  const auto found = terminals_.find(port);
  return found != terminals_.end() ? found->second.path : port;
}

inline void SerialTerminals::run() {
  pthread_setname_np(pthread_self(), "rig serial");
  for (;;) {
    std::vector<pollfd> waited{{ending_[0], POLLIN, 0}};
    for (const auto& [port, terminal] : terminals_) waited.push_back({terminal.master, POLLIN, 0});
    if (::poll(waited.data(), waited.size(), -1) < 0) continue;
    if (waited.front().revents != 0) return;
    std::size_t number = 0;
    for (auto& [port, terminal] : terminals_) {
      if (waited[++number].revents != 0) serve(port, terminal);
    }
  }
}

inline void SerialTerminals::serve(const std::string& port, Terminal& terminal) {
  std::array<std::uint8_t, 256> bytes{};
  const ssize_t count = ::read(terminal.master, bytes.data(), bytes.size());
  if (count <= 0) return;
  const std::int64_t now = steadyNow();
  const bool pause = now - std::exchange(terminal.last_ns, now) > kSilenceNs;
  const std::vector<std::uint8_t> heard =
      listener_(port, bytes.data(), static_cast<std::size_t>(count), pause);
  std::size_t sent = 0;
  while (sent < heard.size()) {
    const ssize_t written = ::write(terminal.master, heard.data() + sent, heard.size() - sent);
    if (written > 0) sent += static_cast<std::size_t>(written);
    if (written < 0 && errno != EINTR) return;
  }
}

}  // namespace stepdriver::test
