#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "peer/peer_lines.h"
#include "port/klipper/board_backend.h"
#include "port/klipper/tty_link.h"
#include "support/port_ear.h"
#include "support/port_on_board.h"

// The port against a program of the real firmware that scripts/klipper_peer.sh has started, in real
// time. With the fake board, a busy computer would decide what these tests say.

namespace stepdriver::klipper {
namespace {

// Steps are sent at once, a second before the first one: a busy computer has time for that.
constexpr Nanoseconds kAhead = 10'000 * kMillisecond;
constexpr Nanoseconds kBegins = 1'000 * kMillisecond;
constexpr Nanoseconds kLongest = 60'000 * kMillisecond;  // until a test gives up
constexpr const char* kPortVariable = "STEPDRIVER_KLIPPER_PORT";

constexpr int kStep = 2;
constexpr int kDir = 3;
constexpr int kEnable = 4;
constexpr int kSwitch = 7;

/// The other end: its port, and its pins.
class Peer {
 public:
  Peer() {
    const char* port = std::getenv(kPortVariable);
    if (port == nullptr) return;
    port_ = port;
    const char* path = std::getenv(test::PeerLines::kFileVariable);
    const int file = path != nullptr ? ::open(path, O_RDWR | O_CLOEXEC) : -1;
    if (file < 0) throw Error(std::string(test::PeerLines::kFileVariable) + " names no file");
    void* memory =
        mmap(nullptr, sizeof(test::PeerLines), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    ::close(file);
    if (memory == MAP_FAILED) throw Error("the lines can't be mapped");
    lines_ = static_cast<test::PeerLines*>(memory);
  }
  ~Peer() {
    if (lines_ != nullptr) munmap(lines_, sizeof(test::PeerLines));
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  /// Empty: there is none.
  const std::string& port() const { return port_; }
  std::uint64_t rises(int pin) const { return lines_->rises.at(static_cast<std::size_t>(pin)); }
  bool level(int pin) const { return lines_->levels.at(static_cast<std::size_t>(pin)) != 0; }
  void set(int pin, bool level) {
    lines_->levels.at(static_cast<std::size_t>(pin)) = level ? 1 : 0;
  }

 private:
  std::string port_;
  test::PeerLines* lines_ = nullptr;
};

/// A terminal that loses, doubles and changes bytes in both directions.
class FaultyTerminal : public Link {
 public:
  FaultyTerminal(const BoardSettings& board, const double& share)
      : link_(board.name, board.port, 250'000), share_(share) {}

  std::ptrdiff_t write(const std::uint8_t* bytes, std::size_t count) noexcept override {
    std::vector<std::uint8_t> spoiled = spoil(bytes, count);
    const std::ptrdiff_t written = link_.write(spoiled.data(), spoiled.size());
    return written < 0 ? written : static_cast<std::ptrdiff_t>(count);
  }
  std::ptrdiff_t read(std::uint8_t* bytes, std::size_t most) noexcept override {
    const std::ptrdiff_t count = link_.read(bytes, most / 2);
    if (count <= 0) return count;
    const std::vector<std::uint8_t> spoiled = spoil(bytes, static_cast<std::size_t>(count));
    std::copy(spoiled.begin(), spoiled.end(), bytes);
    return static_cast<std::ptrdiff_t>(spoiled.size());
  }
  void await(Nanoseconds timeout) override { link_.await(timeout); }

 private:
  std::vector<std::uint8_t> spoil(const std::uint8_t* bytes, std::size_t count) {
    std::vector<std::uint8_t> spoiled;
    for (std::size_t i = 0; i < count; ++i) {
      const bool is_spoiled = std::uniform_real_distribution<double>()(random_) < share_;
      const unsigned kind = is_spoiled ? 1 + random_() % 3 : 0;
      if (kind == 1) continue;
      spoiled.push_back(kind == 2 ? static_cast<std::uint8_t>(bytes[i] ^ (1U << (random_() % 8)))
                                  : bytes[i]);
      if (kind == 3) spoiled.push_back(bytes[i]);
    }
    return spoiled;
  }

  TtyLink link_;
  const double& share_;
  std::mt19937 random_{5};
};

class KlipperPeer : public testing::Test {
 protected:
  KlipperPeer()
      : backend_(none_, clock_, {{"mcu", peer_.port(), kAhead, 0, true}},
                 [this](const BoardSettings& board) {
                   return std::make_unique<FaultyTerminal>(board, faults_);
                 }) {}

  void SetUp() override {
    if (peer_.port().empty()) GTEST_SKIP() << "scripts/klipper_peer.sh runs it";
    const auto pin = [](int number) { return "mcu:gpio" + std::to_string(number); };
    peer_.set(kSwitch, false);
    lines_ = backend_.request(
        {{pin(kStep), false, false}, {pin(kDir), false, false}, {pin(kEnable), false, false}},
        {{pin(kSwitch)}});
    pulse::ChannelConfig config;
    config.step.line = 0;
    config.dir.line = 1;
    config.step_high = config.step_low = 2'000;
    config.endstop_max = pulse::Signal{0, true};
    port_ = backend_.makePort(*lines_, clock_, {config});
    port_->listen(ear_);
    rises_before_ = peer_.rises(kStep);
  }

  const test::Ear::Heard& heard() const { return ear_.heard[0]; }
  bool isOver() const {
    return heard().played + heard().given_back == put_ || heard().failure.error != 0;
  }
  std::uint64_t rises() const { return peer_.rises(kStep) - rises_before_; }

  void serve() {
    const Nanoseconds now = clock_.now();
    port_->serve(now);
    clock_.waitUntil(std::min(port_->due(), now + kMillisecond));
  }
  /// Steps at a rate, of which `forward` of a hundred go forward. @param meanwhile after each pass.
  void play(
      std::size_t steps, Nanoseconds interval, std::size_t forward,
      const std::function<void()>& meanwhile = [] {}) {
    const Nanoseconds start = clock_.now() + begins_;
    const Nanoseconds end = clock_.now() + kLongest;
    const std::size_t before = put_;
    const std::size_t stopped = heard().given_back;
    while (clock_.now() < end) {
      const Nanoseconds now = clock_.now();
      while (put_ - before < steps && heard().given_back == stopped && !is_taken_back_) {
        const std::size_t i = put_ - before;
        const Nanoseconds time = start + static_cast<Nanoseconds>(i) * interval;
        if (time - port_->horizon() > now) break;
        port_->put({0, i % 100 < forward ? 1 : -1, time});
        ++put_;
      }
      serve();
      meanwhile();
      const bool all = put_ - before == steps || heard().given_back != stopped || is_taken_back_;
      if (all && isOver()) break;
    }
    is_taken_back_ = false;
  }
  void takeBack() {
    port_->takeBack(0);
    is_taken_back_ = true;
  }
  void expectAllAccounted() {
    EXPECT_EQ(heard().failure.error, 0) << lines_->failureText(false, 0);
    EXPECT_EQ(heard().played + heard().given_back, put_);
    EXPECT_EQ(rises(), heard().played);
  }

  Nanoseconds begins_ = kBegins;
  double faults_ = 0.0;
  Peer peer_;
  pulse::SteadyClock clock_;
  test::NoBackend none_;
  BoardBackend backend_;
  test::Ear ear_{1};
  std::unique_ptr<gpio::Lines> lines_;
  std::unique_ptr<pulse::StepPort> port_;
  std::size_t put_ = 0;
  std::uint64_t rises_before_ = 0;
  bool is_taken_back_ = false;
};

TEST_F(KlipperPeer, PlaysEachStepOfAMotionOnce) {
  play(4'000, kMillisecond / 4, 60);
  EXPECT_EQ(heard().played, 4'000U);
  EXPECT_EQ(heard().count, 800);
  expectAllAccounted();
}

TEST_F(KlipperPeer, StopsAtOnceAndSaysHowManyStepsItHasMade) {
  for (int round = 0; round < 3; ++round) {
    const std::size_t before = heard().played;
    play(4'000, kMillisecond / 4, round == 1 ? 0 : 100, [&] {
      if (!is_taken_back_ && heard().played > before + 200) takeBack();
    });
    EXPECT_GT(heard().played, before + 200);
    EXPECT_LT(heard().played, before + 4'000);
    expectAllAccounted();
  }
}

TEST_F(KlipperPeer, StopsAtASwitchByItself) {
  play(4'000, kMillisecond / 4, 100, [&] {
    if (heard().played > 200) peer_.set(kSwitch, true);
  });
  EXPECT_EQ(heard().stopped, pulse::EndReason::kEndstopMax);
  EXPECT_GT(heard().given_back, 0U);
  expectAllAccounted();
  ear_.heard[0].stopped.reset();
  play(400, kMillisecond / 4, 0);  // away from it
  EXPECT_FALSE(heard().stopped);
  expectAllAccounted();
}

// The watchdog of an output: the firmware shuts down, and is brought back.
TEST_F(KlipperPeer, MovesAgainAfterAShutdownOfTheFirmware) {
  play(400, kMillisecond / 4, 100);
  expectAllAccounted();
  const gpio::LineWrite enable{2, true};
  ASSERT_EQ(lines_->write(&enable, 1), 0);
  const Nanoseconds end = clock_.now() + kLongest;
  while (!peer_.level(kEnable) && clock_.now() < end) serve();
  while (peer_.level(kEnable) && clock_.now() < end) clock_.waitUntil(clock_.now() + kMillisecond);
  while (heard().failure.error == 0 && clock_.now() < end) serve();
  EXPECT_NE(lines_->failureText(false, 0).find("Missed scheduling"), std::string::npos)
      << lines_->failureText(false, 0);

  backend_.restore(*lines_);
  ASSERT_EQ(lines_->failureText(false, 0), "");
  ear_.heard[0].failure = {};
  EXPECT_FALSE(peer_.level(kEnable));
  rises_before_ = peer_.rises(kStep) - heard().played;  // a pin may change when it is set up again
  play(400, kMillisecond / 4, 50);
  expectAllAccounted();
}

// A computer that is too busy to repeat the blocks in time ends the motion with a fault: then the
// count is said to be doubtful.
TEST_F(KlipperPeer, MakesNoWrongStepWhileTheLineSpoilsBytes) {
  play(100, kMillisecond / 4, 100);
  begins_ = 3 * kBegins;
  faults_ = 0.001;
  play(8'000, kMillisecond / 4, 60);
  faults_ = 0.0;
  if (heard().failure.error != 0) {
    EXPECT_TRUE(heard().doubtful || rises() == heard().played);
    EXPECT_LE(rises(), put_);
    return;
  }
  expectAllAccounted();
  EXPECT_EQ(heard().played, 8'100U);
  EXPECT_EQ(heard().count, 100 + 8'000 / 5);
}

}  // namespace
}  // namespace stepdriver::klipper
