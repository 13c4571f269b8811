#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "sim/fake_board.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::test {

/// Pins that count their rising edges.
class CountingPins : public sim::BoardPins {
 public:
  bool drive(unsigned pin, bool level) override {
    levels.at(pin) = level;
    return true;
  }
  bool listen(unsigned /*pin*/) override { return true; }
  void write(unsigned pin, bool level) override {
    if (level && !levels.at(pin)) ++rises.at(pin);
    levels.at(pin) = level;
  }
  bool read(unsigned pin) override { return levels.at(pin); }

  std::array<std::atomic<std::uint64_t>, 40> rises{};
  std::array<std::atomic<bool>, 40> levels{};  ///< of outputs and inputs
};

/// A fake board behind a pseudo terminal, which plays in real time in a thread of its own. Its time
/// stands still while that thread waits for a processor.
class BoardOnTerminal {
 public:
  explicit BoardOnTerminal(sim::BoardKind kind = sim::rp2040())
      : board_(pins, std::move(kind), 15.0, 0xFFFFF000U) {
    master_ = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    EXPECT_EQ(grantpt(master_), 0);
    EXPECT_EQ(unlockpt(master_), 0);
    port = ptsname(master_);
    // The terminal lives as long as somebody has it open.
    slave_ = open(port.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
    thread_ = std::thread([this] { run(); });
  }
  ~BoardOnTerminal() {
    over_ = true;
    thread_.join();
    close(slave_);
    close(master_);
  }
  BoardOnTerminal(const BoardOnTerminal&) = delete;
  BoardOnTerminal& operator=(const BoardOnTerminal&) = delete;

  CountingPins pins;
  std::string port;

 private:
  void run() {
    constexpr pulse::Nanoseconds kLongestPause = 3'000'000;
    pulse::SteadyClock clock;
    pulse::Nanoseconds last = clock.now();
    pulse::Nanoseconds time = 0;
    while (!over_) {
      pollfd file{master_, POLLIN, 0};
      poll(&file, 1, 1);
      const pulse::Nanoseconds now = clock.now();
      time += std::min(now - last, kLongestPause);
      last = now;
      board_.play(time);
      serve((file.revents & POLLIN) != 0);
    }
  }

  void serve(bool hears) {
    std::array<std::uint8_t, 4096> bytes{};
    if (hears) {
      const ssize_t count = read(master_, bytes.data(), bytes.size());
      if (count > 0) board_.receive(bytes.data(), static_cast<std::size_t>(count));
    }
    const std::vector<std::uint8_t> said = board_.take();
    for (std::size_t at = 0; at < said.size();) {
      const ssize_t count = write(master_, said.data() + at, said.size() - at);
      if (count <= 0) break;
      at += static_cast<std::size_t>(count);
    }
  }

  sim::FakeBoard board_;
  int master_ = -1;
  int slave_ = -1;
  std::atomic<bool> over_{false};
  std::thread thread_;
};

}  // namespace stepdriver::test
