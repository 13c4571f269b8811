#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>

#include "support/node_under_test.h"
#include "support/temporary_folder.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

/// The socket to which a service tells systemd how it is.
class NotifySocket {
 public:
  explicit NotifySocket(const std::string& path)
      : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    EXPECT_LT(path.size(), sizeof address.sun_path);
    std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  ~NotifySocket() { ::close(socket_); }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  /// The next message; empty if none came in that time.
  std::string next(std::chrono::milliseconds longest) {
    timeval time{};
    time.tv_sec = longest.count() / 1000;
    time.tv_usec = longest.count() % 1000 * 1000;
    EXPECT_EQ(::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof time), 0);
    std::array<char, 256> text{};
    const ssize_t size = ::recv(socket_, text.data(), text.size(), 0);
    return size > 0 ? std::string(text.data(), static_cast<std::size_t>(size)) : "";
  }

  /// Whether this message comes, after others or at once.
  bool waitFor(const std::string& wanted) {
    for (;;) {
      const std::string text = next(kBound);
      if (text == wanted) return true;
      if (text.empty()) return false;
    }
  }

 private:
  const int socket_;
};

/// Sets a variable of the environment for the programs that are started meanwhile.
class Environment {
 public:
  Environment(const char* name, const std::string& value) : name_(name) {
    ::setenv(name, value.c_str(), 1);
  }
  ~Environment() { ::unsetenv(name_); }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  const char* const name_;
};

TEST(ServiceManager, HearsThatTheNodeIsReadyAliveAndEnding) {
  const test::TemporaryFolder folder;
  NotifySocket systemd(folder.path() + "/notify");
  NodeUnderTest node;
  {
    const Environment socket("NOTIFY_SOCKET", folder.path() + "/notify");
    const Environment period("WATCHDOG_USEC", "300000");
    node.start();
  }
  EXPECT_TRUE(systemd.waitFor("READY=1"));
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(systemd.waitFor("WATCHDOG=1"));
  EXPECT_TRUE(node.moveTo(0.01, true).success);
  EXPECT_TRUE(systemd.waitFor("WATCHDOG=1"));

  node.process().signal(SIGSTOP);
  while (!systemd.next(std::chrono::milliseconds(500)).empty()) {
  }
  EXPECT_EQ(systemd.next(std::chrono::milliseconds(500)), "");
  node.process().signal(SIGCONT);
  EXPECT_TRUE(systemd.waitFor("WATCHDOG=1"));

  node.process().signal(SIGTERM);
  EXPECT_TRUE(systemd.waitFor("STOPPING=1"));
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0);
}

TEST(ServiceManager, IsNotToldOfLifeWithoutAWatchdog) {
  const test::TemporaryFolder folder;
  NotifySocket systemd(folder.path() + "/notify");
  NodeUnderTest node;
  {
    const Environment socket("NOTIFY_SOCKET", folder.path() + "/notify");
    node.start();
  }
  EXPECT_EQ(systemd.next(kBound), "READY=1");
  EXPECT_EQ(systemd.next(std::chrono::milliseconds(300)), "");
  node.process().signal(SIGTERM);
  EXPECT_EQ(systemd.next(kBound), "STOPPING=1");
}

}  // namespace
}  // namespace stepdriver::node_test
