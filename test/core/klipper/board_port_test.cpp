#include "port/klipper/board_port.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "support/port_ear.h"
#include "support/port_on_board.h"
#include "support/recording_lines.h"

namespace stepdriver::klipper {
namespace {

using pulse::ChannelConfig;
using pulse::EndReason;
using pulse::Signal;
using pulse::StepPort;

constexpr Nanoseconds kStart = 300 * kMillisecond;

/// A line that loses, changes, doubles and delays bytes in both directions.
class FaultyLink : public Link {
 public:
  FaultyLink(sim::FakeBoard& board, pulse::Clock& clock, std::uint64_t seed)
      : board_(board), clock_(clock), random_(seed) {}

  std::ptrdiff_t write(const std::uint8_t* bytes, std::size_t count) noexcept override {
    if (error != 0) return -error;
    spoil(bytes, count, to_board_);
    return static_cast<std::ptrdiff_t>(count);
  }
  std::ptrdiff_t read(std::uint8_t* bytes, std::size_t most) noexcept override {
    if (error != 0) return -error;
    carry();
    std::size_t count = 0;
    while (count < most && !from_board_.empty() && from_board_.front().first <= clock_.now()) {
      bytes[count++] = from_board_.front().second;
      from_board_.pop_front();
    }
    return static_cast<std::ptrdiff_t>(count);
  }
  void await(Nanoseconds /*timeout*/) override {}
  Nanoseconds due() const override {
    Nanoseconds due = board_.due();
    for (const auto* bytes : {&to_board_, &from_board_}) {
      if (!bytes->empty()) due = std::min(due, bytes->front().first);
    }
    return due;
  }

  double share = 0.0;  // of bytes with a fault
  Nanoseconds latency = 0;
  std::uint64_t faults = 0;
  int error = 0;         // of all calls from now on
  bool is_deaf = false;  // what the board says is lost

 private:
  using Bytes = std::deque<std::pair<Nanoseconds, std::uint8_t>>;

  void carry() {
    while (!to_board_.empty() && to_board_.front().first <= clock_.now()) {
      board_.play(to_board_.front().first);
      board_.receive(&to_board_.front().second, 1);
      to_board_.pop_front();
    }
    board_.play(clock_.now());
    const std::vector<std::uint8_t> said = board_.take();
    if (is_deaf) return;
    spoil(said.data(), said.size(), from_board_);
  }

  void spoil(const std::uint8_t* bytes, std::size_t count, Bytes& out) {
    for (std::size_t i = 0; i < count; ++i) {
      if (share <= 0.0 || std::uniform_real_distribution<double>()(random_) >= share) {
        add(bytes[i], out);
        continue;
      }
      ++faults;
      switch (random_() % 8) {
        case 0:
        case 1:
          break;  // lost
        case 2:
        case 3:
          add(bytes[i], out);
          add(bytes[i], out);
          break;
        case 4:
          delayed_ = clock_.now() + delay();
          add(bytes[i], out);
          break;
        default:
          add(static_cast<std::uint8_t>(bytes[i] ^ (1U << (random_() % 8))), out);
      }
    }
  }
  // Mostly up to 10 ms, and rarely up to 200 ms.
  Nanoseconds delay() {
    const auto part = static_cast<Nanoseconds>(random_() % 200);
    return random_() % 50 == 0 ? part * kMillisecond : part * kMillisecond / 20;
  }
  void add(std::uint8_t byte, Bytes& out) {
    Nanoseconds time = std::max(clock_.now() + latency, delayed_);
    if (!out.empty()) time = std::max(time, out.back().first);
    out.emplace_back(time, byte);
  }

  sim::FakeBoard& board_;
  pulse::Clock& clock_;
  std::mt19937_64 random_;
  Bytes to_board_;
  Bytes from_board_;
  Nanoseconds delayed_ = 0;
};

class BoardPortTest : public testing::Test {
 protected:
  static ChannelConfig config(int channel) {
    ChannelConfig config;
    config.step.line = 10 * channel;
    config.dir.line = 10 * channel + 1;
    config.step_high = 1'900;
    config.step_low = 2'100;
    config.dir_setup = 650;
    config.dir_hold = 700;
    return config;
  }

  void make(const std::vector<ChannelConfig>& channels, sim::BoardKind kind = sim::rp2040(),
            std::uint64_t seed = 1) {
    ear = std::make_unique<test::Ear>(channels.size());
    on.reset();
    on = std::make_unique<test::PortOnBoard>(
        lines, clock, channels, std::move(kind), 0.0, [&](sim::FakeBoard& board) {
          auto made = std::make_unique<FaultyLink>(board, clock, seed);
          link = made.get();
          return made;
        });
    port().listen(*ear);
  }
  StepPort& port() { return on->port; }
  const test::Ear::Heard& heard(std::size_t channel = 0) { return ear->heard.at(channel); }

  void runUntil(Nanoseconds time) {
    for (;;) {
      const Nanoseconds next = std::clamp(port().due(), clock.now(), std::max(time, clock.now()));
      while (clock.now() < next) clock.waitUntil(next);
      port().serve(clock.now());
      if (port().due() > time) {
        while (clock.now() < time) clock.waitUntil(time);
        return;
      }
    }
  }

  void put(std::size_t channel, int direction, Nanoseconds time) {
    runUntil(time - port().horizon());
    port().put({channel, direction, time});
    ++put_[channel];
  }
  void finish() { runUntil(clock.now() + 500 * kMillisecond); }

  std::int64_t riseCount(int line) const {
    return static_cast<std::int64_t>(lines.rises(line).size());
  }
  void expectAllAccounted(std::size_t channel = 0) {
    EXPECT_EQ(heard(channel).played + heard(channel).given_back, put_[channel]);
    EXPECT_EQ(riseCount(10 * static_cast<int>(channel)),
              static_cast<std::int64_t>(heard(channel).played));
  }

  pulse::VirtualClock clock;
  test::RecordingLines lines{clock};
  std::unique_ptr<test::Ear> ear;
  FaultyLink* link = nullptr;  // of `on`
  std::unique_ptr<test::PortOnBoard> on;
  std::map<std::size_t, std::size_t> put_;
};

TEST_F(BoardPortTest, StopsAtASwitchByItselfAndGivesTheRestBack) {
  ChannelConfig guarded = config(0);
  guarded.endstop_max = Signal{7, true};
  guarded.endstop_min = Signal{8, true};
  lines.inputs[8] = 1;  // of the other direction
  make({guarded});
  for (int i = 0; i < 40; ++i) put(0, 1, kStart + i * kMillisecond);
  runUntil(kStart + 5 * kMillisecond + kMillisecond / 2);
  lines.inputs[7] = 1;
  finish();
  EXPECT_EQ(heard().stopped, EndReason::kEndstopMax);
  EXPECT_EQ(heard().played, 6u);
  EXPECT_EQ(heard().given_back, 34u);
  expectAllAccounted();

  // Away from it, and back against it.
  const Nanoseconds again = clock.now() + 100 * kMillisecond;
  lines.inputs[8] = 0;
  for (int i = 0; i < 10; ++i) put(0, -1, again + i * kMillisecond);
  finish();
  EXPECT_EQ(heard().played, 16u);
  EXPECT_EQ(heard().count, -4);
  ear->heard[0].stopped.reset();
  put(0, 1, clock.now() + 100 * kMillisecond);
  finish();
  EXPECT_EQ(heard().stopped, EndReason::kEndstopMax) << "it is active from the start";
  EXPECT_EQ(heard().played, 16u);
  expectAllAccounted();
}

TEST_F(BoardPortTest, WatchesTheOtherSwitchFromATurnOn) {
  ChannelConfig guarded = config(0);
  guarded.endstop_max = Signal{7, true};
  guarded.endstop_min = Signal{8, true};
  make({guarded});
  for (int i = 0; i < 40; ++i) put(0, i < 20 ? 1 : -1, kStart + i * kMillisecond);
  runUntil(kStart + 10 * kMillisecond + kMillisecond / 2);
  lines.inputs[8] = 1;  // behind it
  runUntil(kStart + 15 * kMillisecond);
  EXPECT_FALSE(heard().stopped);
  lines.inputs[8] = 0;
  runUntil(kStart + 25 * kMillisecond + kMillisecond / 2);
  lines.inputs[7] = 1;  // behind it again
  runUntil(kStart + 30 * kMillisecond + kMillisecond / 2);
  EXPECT_FALSE(heard().stopped);
  lines.inputs[8] = 1;
  finish();
  EXPECT_EQ(heard().stopped, EndReason::kEndstopMin);
  EXPECT_EQ(heard().played, 31u);
  expectAllAccounted();
}

TEST_F(BoardPortTest, StopsAtAFaultAndNamesTheMotor) {
  ChannelConfig gantry = config(0);
  pulse::MotorSignals& twin = gantry.twins.emplace_back();
  twin.step.line = 2;
  twin.dir.line = 3;
  twin.fault = Signal{7, false};
  lines.inputs[7] = 1;
  make({gantry});
  for (int i = 0; i < 20; ++i) put(0, 1, kStart + i * kMillisecond);
  runUntil(kStart + kMillisecond / 2);
  lines.inputs[7] = 0;
  finish();
  EXPECT_EQ(heard().stopped, EndReason::kChipFault);
  EXPECT_EQ(heard().motor, 1u);
  EXPECT_EQ(heard().played, 1u);
  EXPECT_EQ(riseCount(2), 1);
  expectAllAccounted();
}

TEST_F(BoardPortTest, IgnoresASwitchThatIsPressedAtRest) {
  ChannelConfig guarded = config(0);
  guarded.endstop_max = Signal{7, true};
  make({guarded});
  for (int i = 0; i < 5; ++i) put(0, 1, kStart + i * kMillisecond);
  finish();
  lines.inputs[7] = 1;
  finish();
  lines.inputs[7] = 0;
  for (int i = 0; i < 5; ++i) put(0, 1, clock.now() + 60 * kMillisecond);
  finish();
  EXPECT_FALSE(heard().stopped);
  EXPECT_EQ(heard().played, 10u);
}

// 100,000 steps/s on each of three axes: no step is pushed back, and the queue of the board is
// large enough.
TEST_F(BoardPortTest, PlaysAHundredThousandStepsASecondOnThreeAxes) {
  ChannelConfig fast[3] = {config(0), config(1), config(2)};
  make({fast[0], fast[1], fast[2]}, sim::stm32f446());
  constexpr int kSteps = 100'000;
  std::vector<Nanoseconds> times;
  for (int i = 0; i < kSteps; ++i) {
    const Nanoseconds time = kStart + i * Nanoseconds{10'000};
    times.push_back(time);
    for (std::size_t axis = 0; axis < 3; ++axis) put(axis, 1, time + static_cast<int>(axis) * 700);
  }
  finish();
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<Nanoseconds> rises = lines.rises(10 * axis);
    ASSERT_EQ(rises.size(), times.size());
    for (std::size_t i = 0; i < rises.size(); ++i) {
      // A tick of 180 MHz is 6 ns; what isn't known of its clock adds another.
      ASSERT_NEAR(static_cast<double>(rises[i]), static_cast<double>(times[i] + axis * 700), 18.0);
    }
    expectAllAccounted(static_cast<std::size_t>(axis));
  }
  EXPECT_EQ(on->board.pushedBack(), 0u);
  EXPECT_EQ(on->board.droppedMoves(), 0u);
  EXPECT_FALSE(on->board.isShutdown()) << on->board.reason();
}

TEST_F(BoardPortTest, StopsWithItsReasonWhenTheFirmwareShutsDown) {
  make({config(0), config(1)});
  for (int i = 0; i < 100; ++i) {
    put(0, 1, kStart + i * kMillisecond);
    put(1, 1, kStart + i * kMillisecond);
    if (i == 70) on->board.shutDown("Timer too close");
  }
  finish();
  for (const std::size_t channel : {0U, 1U}) {
    EXPECT_EQ(heard(channel).failure.error, EREMOTEIO);
    EXPECT_TRUE(heard(channel).doubtful);
    EXPECT_EQ(heard(channel).played + heard(channel).given_back, put_[channel]);
  }
  EXPECT_EQ(on->held->failureText(false, 0),
            "the firmware of the board mcu has shut down: Timer too close");
}

TEST_F(BoardPortTest, StopsWhenTheBoardIsResetOrItsCableIsPulled) {
  for (const bool pulled : {false, true}) {
    put_.clear();
    make({config(0)});
    const Nanoseconds start = clock.now() + kStart;
    for (int i = 0; i < 100; ++i) {
      put(0, 1, start + i * kMillisecond);
      if (i == 70 && pulled) link->error = ENODEV;
      if (i == 70 && !pulled) on->board.powerCycle();
    }
    finish();
    EXPECT_EQ(heard().failure.error, ENODEV) << pulled;
    EXPECT_TRUE(heard().doubtful);
    EXPECT_EQ(heard().played + heard().given_back, put_[0]);
    const std::string reason = on->held->failureText(false, 0);
    EXPECT_NE(reason.find(pulled ? "line to the board mcu" : "board mcu was reset"),
              std::string::npos)
        << reason;
    const gpio::LineWrite write{2, true};
    EXPECT_NE(on->held->write(&write, 1), 0) << "nothing can be written";
  }
}

TEST_F(BoardPortTest, GivesUpASilentBoard) {
  make({config(0)});
  for (int i = 0; i < 100; ++i) {
    put(0, 1, kStart + i * kMillisecond);
    if (i == 70) link->share = 1.0;  // nothing arrives as it was sent
  }
  runUntil(clock.now() + 5'000 * kMillisecond);
  EXPECT_NE(heard().failure.error, 0);
  EXPECT_TRUE(heard().doubtful);
  EXPECT_EQ(heard().played + heard().given_back, put_[0]);
}

// The computer is suspended for 10 s in a motion: the board plays what it has, and then switches
// off the outputs that nobody confirms.
TEST_F(BoardPortTest, LetsTheBoardSwitchOffWhenTheProgramStandsStill) {
  ChannelConfig wide = config(0);
  wide.step.line = 0;
  wide.dir.line = 5;  // lines 1 to 4 are outputs
  make({wide});
  const gpio::LineWrite enable{3, true};
  ASSERT_EQ(on->held->write(&enable, 1), 0);
  for (int i = 0; i < 100; ++i) put(0, 1, kStart + i * kMillisecond);
  ASSERT_TRUE(lines.levels[3]);
  const Nanoseconds stopped = clock.now();
  for (Nanoseconds time = stopped; time < stopped + 10'000 * kMillisecond; time += kMillisecond) {
    clock.waitUntil(time);
    on->board.play(time);
    if (time > stopped + 2'100 * kMillisecond) {
      ASSERT_FALSE(lines.levels[3]);
    }
  }
  const std::int64_t rises = riseCount(0);
  EXPECT_GE(rises, 50);
  EXPECT_LE(rises, 100);
  finish();
  EXPECT_EQ(heard().failure.error, EREMOTEIO);
  EXPECT_TRUE(heard().doubtful);
  EXPECT_EQ(riseCount(0), rises) << "steps went out afterwards";
  EXPECT_NE(on->held->failureText(false, 0).find("Missed scheduling"), std::string::npos);
}

TEST_F(BoardPortTest, KeepsAnOutputOnAsLongAsItIsServed) {
  ChannelConfig wide = config(0);
  wide.dir.line = 5;
  make({wide});
  const gpio::LineWrite enable{3, true};
  ASSERT_EQ(on->held->write(&enable, 1), 0);
  runUntil(clock.now() + 10'000 * kMillisecond);
  EXPECT_TRUE(lines.levels[3]);
  EXPECT_FALSE(on->board.isShutdown()) << on->board.reason();
  on.reset();
  EXPECT_FALSE(lines.levels[3]) << "it isn't safe at the end";
}

// Steps that come too late for the board end the motion, instead of being played at once. Those
// that it has are played, and the count is right.
TEST_F(BoardPortTest, FailsIfTheBoardRunsOutOfSteps) {
  make({config(0)});
  for (int i = 0; i < 60; ++i) put(0, 1, kStart + i * kMillisecond);
  runUntil(kStart + 30 * kMillisecond);
  // The program is away for 29 ms, and the next steps are due now.
  const Nanoseconds back = kStart + 59 * kMillisecond + kMillisecond / 2;
  while (clock.now() < back) clock.waitUntil(back);
  for (int i = 60; i < 80; ++i) {
    port().put({0, 1, kStart + i * kMillisecond});
    ++put_[0];
  }
  port().serve(clock.now());
  finish();
  EXPECT_EQ(heard().failure.error, ETIME);
  EXPECT_FALSE(heard().doubtful) << "the board has said where it stands";
  EXPECT_FALSE(on->board.isShutdown()) << on->board.reason();
  expectAllAccounted();
}

// A motor that goes back and forth is at a place more than once: what it says after a while without
// an answer must not be taken for an earlier time.
TEST_F(BoardPortTest, CountsAMotorThatGoesBackAndForthWhileAnswersAreLost) {
  for (int turn = 60; turn < 140; ++turn) {
    SCOPED_TRACE(testing::Message() << "turns after " << turn << " steps");
    put_.clear();
    lines.edges.clear();
    make({config(0)});
    constexpr int kSteps = 600;
    constexpr Nanoseconds kInterval = kMillisecond / 4;
    const Nanoseconds start = clock.now() + kStart;
    for (int i = 0; i < kSteps; ++i) {
      const Nanoseconds time = start + i * kInterval;
      put(0, i / turn % 2 == 0 ? 1 : -1, time);
      // Its answers are lost in each second of these times.
      link->is_deaf = i / 160 % 2 == 1;
    }
    link->is_deaf = false;
    finish();
    ASSERT_EQ(heard().failure.error, 0);
    ASSERT_FALSE(heard().doubtful);
    ASSERT_EQ(heard().played, static_cast<std::size_t>(kSteps));
    expectAllAccounted();
  }
}

// 100,000 faults of the line: no step is played that wasn't put, none twice, and none at another
// time; and the count is that of the edges, or it is said to be doubtful.
TEST_F(BoardPortTest, PlaysNoWrongStepWhateverTheLineDoes) {
  std::uint64_t faults = 0;
  int failed = 0;
  int doubtful = 0;
  int rounds = 0;
  for (std::uint64_t seed = 1; faults < 100'000; ++seed, ++rounds) {
    ASSERT_LT(rounds, 2'000);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    lines.edges.clear();
    put_.clear();
    make({config(0), config(1)}, seed % 2 == 0 ? sim::rp2040() : sim::atmega2560(), seed);
    std::map<std::size_t, std::vector<Nanoseconds>> times;
    finish();  // its clock is known then
    link->share = seed % 4 == 0 ? 0.01 : 0.004;
    link->latency = static_cast<Nanoseconds>(random() % 3) * kMillisecond / 2;
    const Nanoseconds start = clock.now() + 100 * kMillisecond;
    Nanoseconds time = start;
    for (int i = 0; i < 3'000; ++i) {
      time += 20'000 + static_cast<Nanoseconds>(random() % 400'000);
      const std::size_t channel = random() % 2;
      if (heard(channel).failure.error != 0) continue;
      put(channel, i / 500 % 2 == 0 ? 1 : -1, time);
      times[channel].push_back(time);
    }
    link->share = 0.0;
    runUntil(clock.now() + 3'000 * kMillisecond);
    faults += link->faults;
    for (const std::size_t channel : {0U, 1U}) {
      const std::vector<Nanoseconds> rises = lines.rises(10 * static_cast<int>(channel));
      const test::Ear::Heard& of = heard(channel);
      ASSERT_EQ(of.played + of.given_back, put_[channel]);
      if (of.failure.error != 0) ++failed;
      if (of.doubtful) {
        ++doubtful;
        ASSERT_LE(rises.size(), times[channel].size());
      } else {
        ASSERT_EQ(rises.size(), of.played);
      }
      for (std::size_t i = 0; i < rises.size(); ++i) {
        ASSERT_NEAR(static_cast<double>(rises[i]), static_cast<double>(times[channel][i]), 4e6)
            << "step " << i;
      }
    }
  }
  RecordProperty("rounds", rounds);
  RecordProperty("failed channels", failed);
  RecordProperty("doubtful channels", doubtful);
  EXPECT_LT(failed, 2 * rounds * 3 / 4) << "it gives up at once";
}

}  // namespace
}  // namespace stepdriver::klipper
