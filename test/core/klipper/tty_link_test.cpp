#include "port/klipper/tty_link.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <stdlib.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "port/klipper/board_backend.h"
#include "sim/fake_board.h"
#include "support/port_ear.h"
#include "support/port_on_board.h"

namespace stepdriver::klipper {
namespace {

/// Pins that count their rising edges.
class CountingPins : public sim::BoardPins {
 public:
  bool drive(unsigned pin, bool level) override {
    levels_.at(pin) = level;
    return true;
  }
  bool listen(unsigned /*pin*/) override { return true; }
  void write(unsigned pin, bool level) override {
    if (level && !levels_.at(pin)) ++rises.at(pin);
    levels_.at(pin) = level;
  }
  bool read(unsigned /*pin*/) override { return false; }

  std::array<std::atomic<int>, 40> rises{};

 private:
  std::array<bool, 40> levels_{};
};

/// A fake board behind a pseudo terminal, which plays in real time in a thread of its own.
class BoardOnTerminal {
 public:
  BoardOnTerminal() : master_(posix_openpt(O_RDWR | O_NOCTTY)) {
    EXPECT_EQ(grantpt(master_), 0);
    EXPECT_EQ(unlockpt(master_), 0);
    port = ptsname(master_);
    // The terminal lives as long as somebody has it open.
    slave_ = open(port.c_str(), O_RDWR | O_NOCTTY);
    thread_ = std::thread([this] { run(); });
  }
  ~BoardOnTerminal() {
    over_ = true;
    thread_.join();
    close(slave_);
    if (master_ >= 0) close(master_);
  }
  BoardOnTerminal(const BoardOnTerminal&) = delete;
  BoardOnTerminal& operator=(const BoardOnTerminal&) = delete;

  CountingPins pins;
  std::string port;

 private:
  void run() {
    sim::FakeBoard board(pins, sim::rp2040(), 15.0, 0xFFFFF000U);
    pulse::SteadyClock clock;
    const pulse::Nanoseconds start = clock.now();
    while (!over_) {
      pollfd file{master_, POLLIN, 0};
      poll(&file, 1, 1);
      std::array<std::uint8_t, 4096> bytes{};
      board.play(clock.now() - start);
      if ((file.revents & POLLIN) != 0) {
        const ssize_t count = read(master_, bytes.data(), bytes.size());
        if (count > 0) board.receive(bytes.data(), static_cast<std::size_t>(count));
      }
      const std::vector<std::uint8_t> said = board.take();
      for (std::size_t at = 0; at < said.size();) {
        const ssize_t count = write(master_, said.data() + at, said.size() - at);
        if (count <= 0) break;
        at += static_cast<std::size_t>(count);
      }
    }
  }

  int master_;
  int slave_ = -1;
  std::atomic<bool> over_{false};
  std::thread thread_;
};

std::string refusalOfPort(const std::string& path, int baud = 250'000) {
  try {
    const TtyLink link("mcu", path, baud);
  } catch (const BoardError& error) {
    return error.what();
  }
  return "";
}

TEST(TtyLink, SaysWhyAPortCannotBeUsed) {
  EXPECT_NE(refusalOfPort("/nonexistent/port").find("there is no such port"), std::string::npos);
  EXPECT_NE(refusalOfPort("/dev/null").find("it is no serial port"), std::string::npos);
  BoardOnTerminal terminal;
  const TtyLink first("mcu", terminal.port, 250'000);
  const std::string text = refusalOfPort(terminal.port);
  EXPECT_NE(text.find("another program uses it"), std::string::npos) << text;
  EXPECT_NE(text.find(terminal.port), std::string::npos) << text;
}

// In real time and over a terminal of the kernel: each step is played once. Half a second ahead is
// more than a busy computer stalls.
TEST(TtyLink, CarriesTheStepsOfAMotionToABoard) {
  BoardOnTerminal terminal;
  pulse::SteadyClock clock;
  test::NoBackend none;
  BoardBackend backend(none, clock, {{"mcu", terminal.port, 500 * kMillisecond}},
                       [](const BoardSettings& settings) {
                         return std::make_unique<TtyLink>(settings.name, settings.port, 250'000);
                       });
  const auto lines =
      backend.request({{"mcu:gpio2", false, false}, {"mcu:gpio3", false, false}}, {});
  pulse::ChannelConfig config;
  config.step.line = 0;
  config.dir.line = 1;
  config.step_high = config.step_low = 2'000;
  const auto port = backend.makePort(*lines, clock, {config});
  test::Ear ear(1);
  port->listen(ear);

  constexpr int kSteps = 2'000;
  const pulse::Nanoseconds start = clock.now() + 600 * kMillisecond;
  const pulse::Nanoseconds end = clock.now() + 60'000 * kMillisecond;
  int put = 0;
  while (ear.heard[0].played + ear.heard[0].given_back < kSteps && clock.now() < end) {
    const pulse::Nanoseconds now = clock.now();
    for (; put < kSteps; ++put) {
      const pulse::Nanoseconds time = start + put * (kMillisecond / 4);
      if (time - port->horizon() > now) break;
      port->put({0, put % 100 < 60 ? 1 : -1, time});
    }
    port->serve(now);
    clock.waitUntil(std::min(port->due(), now + kMillisecond));
  }
  EXPECT_EQ(ear.heard[0].played, static_cast<std::size_t>(kSteps))
      << lines->failureText(false, 0) << ", error " << ear.heard[0].failure.error << ", stopped "
      << ear.heard[0].stopped.has_value();
  EXPECT_EQ(ear.heard[0].count, kSteps / 5);
  EXPECT_EQ(terminal.pins.rises[2], kSteps);
}

}  // namespace
}  // namespace stepdriver::klipper
