#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "channel/watched_lines.h"
#include "port/gpio_port.h"
#include "port/step_port.h"
#include "support/ahead_port.h"
#include "support/port_ear.h"
#include "support/port_on_board.h"
#include "support/recording_lines.h"

/// The contract of StepPort, for each port. A new port adds a type with a board().
namespace stepdriver::pulse {
namespace {

constexpr Nanoseconds kMillisecond = 1'000'000;
constexpr Nanoseconds kStart = 100 * kMillisecond;

using test::Ear;

/// What carries out what was put: nobody but serve(), or a board of its own.
struct Gpio {
  static constexpr Nanoseconds kEarly = 0;
  static constexpr bool kHasAllDrivers = true;  // with CW and CCW, or steps at both edges
  static constexpr bool kLinesFail = true;      // one by one
  Gpio(gpio::Lines& lines, Clock& clock, const std::vector<ChannelConfig>& channels)
      : watched(lines), port(watched, clock, channels) {}
  static std::string name() { return "Gpio"; }
  static Nanoseconds due() { return kNever; }
  static void play(Nanoseconds /*now*/) {}

  WatchedLines watched;
  GpioPort port;
};

template <Nanoseconds kLate>
struct Ahead {
  static constexpr Nanoseconds kEarly = std::max<Nanoseconds>(0, -kLate);
  static constexpr bool kHasAllDrivers = true;
  static constexpr bool kLinesFail = true;
  Ahead(gpio::Lines& lines, Clock& clock, const std::vector<ChannelConfig>& channels,
        Nanoseconds take_back = 0)
      : port(lines, clock, channels,
             {50 * kMillisecond, [](const StepPort::Step& /*step*/) { return kLate; }, take_back}) {
  }
  static std::string name() {
    if (kLate == 0) return "Ahead";
    return kLate > 0 ? "AheadAndLate" : "AheadAndEarly";
  }
  Nanoseconds due() { return port.playDue(); }
  void play(Nanoseconds now) { port.play(now); }

  test::AheadPort port;
};

/// Boards with Klipper's firmware, by their clocks and queues.
template <sim::BoardKind (*kKind)(), int kDriftPpm>
struct OnBoard : test::PortOnBoard {
  // Two ticks; and its clock is known only by what it says in the first quarter of a second.
  static constexpr Nanoseconds kEarly = 250 + 120 * std::max(0, kDriftPpm);
  static constexpr bool kHasAllDrivers = false;
  static constexpr bool kLinesFail = false;
  OnBoard(gpio::Lines& lines, Clock& clock, const std::vector<ChannelConfig>& channels)
      : PortOnBoard(lines, clock, channels, kKind(), kDriftPpm) {}
  static std::string name() { return kKind().mcu; }
  static Nanoseconds due() { return kNever; }
  static void play(Nanoseconds /*now*/) {}
};

template <typename Board>
class StepPortConformance : public testing::Test {
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

  void make(const std::vector<ChannelConfig>& channels) {
    configs = channels;
    ear = std::make_unique<Ear>(channels.size());
    board = std::make_unique<Board>(lines, clock, channels);
    port().listen(*ear);
  }
  StepPort& port() { return board->port; }
  const Ear::Heard& heard(std::size_t channel = 0) { return ear->heard.at(channel); }

  void runUntil(Nanoseconds time) {
    for (;;) {
      const Nanoseconds due = std::min(port().due(), board->due());
      const Nanoseconds next = std::min(std::max(due, clock.now()), time);
      while (clock.now() < next) clock.waitUntil(next);
      board->play(clock.now());
      port().serve(clock.now());
      if (due > time) return;
    }
  }

  /// Puts one step as its header says. @return its time.
  void put(StepPort::Step step) {
    const StepPort::Lane& lane = port().lane(step.channel);
    if (!lane.accepts(step.direction)) {
      while (lane.busy) runUntil(std::min(port().due(), clock.now() + kMillisecond));
      if (!lane.accepts(step.direction)) port().aim(step.channel, step.direction);
      while (!lane.accepts(step.direction)) runUntil(std::max(port().due(), clock.now()));
    }
    step.time = std::max(step.time, lane.takes);
    if ((step.forward | step.backward) == 0) {
      (step.direction > 0 ? step.forward : step.backward) = StepPort::laneBit(step.channel);
    }
    runUntil(step.time - port().horizon());
    port().put(step);
    port().serve(clock.now());
  }

  /// The levels of STEP and DIR of each motor keep the chip's times.
  void expectTimes(const ChannelConfig& channel, const MotorSignals& motor) {
    std::optional<Nanoseconds> rose;
    std::optional<Nanoseconds> fell;
    std::optional<Nanoseconds> turned;
    std::optional<std::size_t> dir_write;
    for (const test::Edge& edge : lines.edges) {
      const auto since = [&edge](const std::optional<Nanoseconds>& time) {
        return time ? edge.time - *time : kNever;
      };
      SCOPED_TRACE(testing::Message() << "line " << edge.line << " at " << edge.time);
      if (edge.line == motor.dir.line) {
        EXPECT_GE(since(rose), channel.dir_hold);
        turned = edge.time;
        dir_write = edge.write;
      } else if (edge.line == motor.step.line && edge.level) {
        EXPECT_NE(edge.write, dir_write) << "STEP and DIR in one write";
        EXPECT_GE(since(fell), channel.step_low);
        EXPECT_GE(since(turned), channel.dir_setup);
        rose = edge.time;
      } else if (edge.line == motor.step.line) {
        EXPECT_GE(since(rose), channel.step_high);
        fell = edge.time;
      }
    }
  }

  std::int64_t risesOf(const MotorSignals& motor) {
    return static_cast<std::int64_t>(lines.rises(motor.step.line).size());
  }

  VirtualClock clock;
  test::RecordingLines lines{clock};
  std::vector<ChannelConfig> configs;
  std::unique_ptr<Ear> ear;
  std::unique_ptr<Board> board;
};

using Boards =
    testing::Types<Gpio, Ahead<0>, Ahead<300'000>, Ahead<-300'000>, OnBoard<sim::rp2040, 0>,
                   OnBoard<sim::stm32f446, 40>, OnBoard<sim::atmega2560, -100>>;
struct BoardNames {
  template <typename Board>
  // NOLINTNEXTLINE(readability-identifier-naming): googletest's name
  static std::string GetName(int /*index*/) {
    return Board::name();
  }
};
TYPED_TEST_SUITE(StepPortConformance, Boards, BoardNames);

TYPED_TEST(StepPortConformance, PlaysEachStepOnceInOrderAndNotBeforeItsTime) {
  this->make({TestFixture::config(0)});
  std::vector<Nanoseconds> times;
  for (int i = 0; i < 12; ++i) {
    times.push_back(kStart + i * kMillisecond);
    this->put({0, i < 7 ? 1 : -1, times.back()});
  }
  this->runUntil(kStart + 100 * kMillisecond);

  EXPECT_EQ(this->heard().played, times.size());
  EXPECT_EQ(this->heard().count, 2);
  EXPECT_EQ(this->heard().given_back, 0u);
  const std::vector<Nanoseconds> rises = this->lines.rises(0);
  ASSERT_EQ(rises.size(), times.size());
  for (std::size_t i = 0; i < times.size(); ++i) {
    EXPECT_GE(rises[i], times[i] - TypeParam::kEarly) << "step " << i;
    EXPECT_LE(rises[i], this->heard().times[i]) << "step " << i;
  }
  EXPECT_FALSE(this->lines.levels[0]) << "the last pulse hasn't ended";
  EXPECT_FALSE(this->lines.levels[1]) << "it doesn't stand backward";
}

TYPED_TEST(StepPortConformance, KeepsTheTimesOfTheChipForStepsThatAreTooClose) {
  this->make({TestFixture::config(0)});
  std::mt19937_64 random(5);
  Nanoseconds time = kStart;
  for (int i = 0; i < 500; ++i) {
    time += static_cast<Nanoseconds>(random() % 6'000);
    this->put({0, random() % 4 == 0 ? -1 : 1, time});
  }
  this->runUntil(time + 100 * kMillisecond);

  EXPECT_EQ(this->heard().played, 500u);
  EXPECT_EQ(this->risesOf(this->configs[0]), 500);
  this->expectTimes(this->configs[0], this->configs[0]);
}

TYPED_TEST(StepPortConformance, TellsOfEachStepWhetherItWasPlayedOrGivenBack) {
  this->make({TestFixture::config(0), TestFixture::config(1)});
  std::size_t put = 0;
  for (Nanoseconds time = kStart; this->clock.now() < kStart + 10 * kMillisecond;
       time += kMillisecond / 2) {
    this->put({0, 1, time});
    this->put({1, -1, time});
    ++put;
  }
  const auto played = static_cast<std::size_t>(this->risesOf(this->configs[0]));
  this->port().takeBack(0);
  this->runUntil(this->clock.now() + 200 * kMillisecond);

  EXPECT_EQ(this->heard(0).played, played) << "steps went out after they were taken back";
  EXPECT_EQ(this->heard(0).played + this->heard(0).given_back, put);
  EXPECT_EQ(this->risesOf(this->configs[0]), this->heard(0).count);
  EXPECT_FALSE(this->lines.levels[0]) << "the last pulse hasn't ended";
  EXPECT_EQ(this->heard(1).played, put) << "of another channel";
  EXPECT_EQ(this->risesOf(this->configs[1]), -this->heard(1).count);
}

TYPED_TEST(StepPortConformance, PlaysNothingThatIsTakenBackAtOnce) {
  this->make({TestFixture::config(0)});
  this->put({0, 1, kStart});
  this->runUntil(kStart + 100 * kMillisecond);
  this->runUntil(kStart + 200 * kMillisecond);
  const StepPort::Step step{0, 1, this->clock.now() + this->port().horizon()};
  this->port().put(step);
  this->port().takeBack(0);
  this->runUntil(step.time + 200 * kMillisecond);
  EXPECT_EQ(this->heard().played, 1u);
  EXPECT_EQ(this->risesOf(this->configs[0]), 1);

  this->put({0, -1, this->clock.now() + 100 * kMillisecond});
  this->runUntil(this->clock.now() + 200 * kMillisecond);
  EXPECT_EQ(this->heard().played, 2u) << "it takes no step afterwards";
  EXPECT_EQ(this->heard().count, 0);
}

TYPED_TEST(StepPortConformance, StepsAllMotorsOfAChannelButThoseThatAreStill) {
  ChannelConfig config = TestFixture::config(0);
  MotorSignals& twin = config.twins.emplace_back();
  twin.step.line = 2;
  twin.dir.line = 3;
  this->make({config});
  this->put({0, 1, kStart});
  this->put({0, 1, kStart + kMillisecond, motorBit(0)});
  this->put({0, -1, kStart + 2 * kMillisecond, motorBit(1)});
  this->put({0, -1, kStart + 3 * kMillisecond});
  this->runUntil(kStart + 100 * kMillisecond);

  EXPECT_EQ(this->risesOf(config), 3);
  EXPECT_EQ(this->risesOf(twin), 3);
  EXPECT_EQ(this->heard().still, (std::vector<MotorSet>{0, motorBit(0), motorBit(1), 0}));
  this->expectTimes(config, config);
  this->expectTimes(config, twin);
}

TYPED_TEST(StepPortConformance, KnowsDriversWithLinesForEachDirectionAndStepsOnBothEdges) {
  if (!TypeParam::kHasAllDrivers) GTEST_SKIP() << "it refuses them";
  ChannelConfig cw_ccw = TestFixture::config(0);
  cw_ccw.dir_steps = true;
  ChannelConfig both = TestFixture::config(1);
  both.both_edges = true;
  this->make({cw_ccw, both});
  for (int i = 0; i < 6; ++i) {
    const Nanoseconds time = kStart + i * kMillisecond;
    this->put({0, i < 4 ? 1 : -1, time});
    this->put({1, 1, time});
  }
  this->runUntil(kStart + 100 * kMillisecond);

  EXPECT_EQ(this->lines.rises(0).size(), 4u);
  EXPECT_EQ(this->lines.rises(1).size(), 2u);
  EXPECT_EQ(this->lines.rises(10).size(), 3u) << "each edge is a step";
  EXPECT_EQ(this->heard(1).count, 6);
}

TYPED_TEST(StepPortConformance, NamesALineThatFailsAndPlaysTheOtherChannels) {
  if (!TypeParam::kLinesFail) GTEST_SKIP() << "nobody hears of it";
  this->make({TestFixture::config(0), TestFixture::config(1)});
  std::size_t put = 0;
  for (int i = 0; i < 3; ++i, ++put) {
    this->put({0, 1, kStart + i * kMillisecond});
    this->put({1, 1, kStart + i * kMillisecond});
  }
  this->runUntil(kStart + kMillisecond / 2);
  this->lines.broken = 0;
  for (int i = 3; i < 10; ++i) this->put({1, 1, kStart + i * kMillisecond});
  if (this->port().horizon() == 0) this->put({0, 1, kStart + 10 * kMillisecond});
  this->runUntil(kStart + 200 * kMillisecond);

  EXPECT_EQ(this->heard(0).failure.line, 0);
  EXPECT_EQ(this->heard(0).failure.error, ENODEV);
  EXPECT_FALSE(this->heard(0).failure.input);
  EXPECT_EQ(this->risesOf(this->configs[0]), this->heard(0).count);
  if (this->port().horizon() != 0) {
    EXPECT_EQ(this->heard(0).played + this->heard(0).given_back, put);
  }
  EXPECT_EQ(this->heard(1).failure.error, 0);
  EXPECT_EQ(this->heard(1).played, 10u);
}

// ---- what only ports with a horizon promise ----

using Punctual = Ahead<0>;

class PortWithAHorizon : public StepPortConformance<Punctual> {};

TEST_F(PortWithAHorizon, StopsAtASwitchByItselfAndGivesTheRestBack) {
  ChannelConfig guarded = config(0);
  guarded.endstop_max = Signal{7, true};
  guarded.endstop_min = Signal{8, true};
  lines.inputs[8] = 1;  // of the other direction
  make({guarded});
  for (int i = 0; i < 20; ++i) put({0, 1, kStart + i * kMillisecond});
  runUntil(kStart + 5 * kMillisecond + kMillisecond / 2);
  EXPECT_EQ(heard().played, 6u);
  lines.inputs[7] = 1;
  runUntil(kStart + 200 * kMillisecond);

  EXPECT_EQ(heard().stopped, EndReason::kEndstopMax);
  EXPECT_EQ(heard().played, 6u);
  EXPECT_EQ(heard().given_back, 14u);
  EXPECT_EQ(risesOf(guarded), 6);
}

TEST_F(PortWithAHorizon, StopsAtAFaultOfTheChip) {
  ChannelConfig guarded = config(0);
  guarded.fault = Signal{7, false};
  lines.inputs[7] = 1;
  make({guarded});
  for (int i = 0; i < 4; ++i) put({0, 1, kStart + i * kMillisecond});
  runUntil(kStart + kMillisecond / 2);
  lines.inputs[7] = 0;
  runUntil(kStart + 200 * kMillisecond);
  EXPECT_EQ(heard().stopped, EndReason::kChipFault);
  EXPECT_EQ(heard().played, 1u);
  EXPECT_EQ(heard().given_back, 3u);
}

TEST_F(PortWithAHorizon, StopsAtASwitchOfAnAxisThatSharesTheMotor) {
  ChannelConfig axis = config(1);
  axis.endstop_min = Signal{7, true};
  make({config(0), axis});
  const StepPort::LaneSet other = StepPort::laneBit(1);
  for (int i = 0; i < 20; ++i) put({0, 1, kStart + i * kMillisecond, 0, 0, other});
  runUntil(kStart + kMillisecond / 2);
  lines.inputs[7] = 1;
  runUntil(kStart + 200 * kMillisecond);
  EXPECT_EQ(heard().stopped, EndReason::kEndstopMin);
  EXPECT_EQ(heard().lane, 1u);
  EXPECT_EQ(heard().played, 1u);
  // Away from it.
  for (int i = 0; i < 3; ++i) put({0, 1, clock.now() + kMillisecond, 0, other, 0});
  runUntil(clock.now() + 200 * kMillisecond);
  EXPECT_EQ(heard().played, 4u);
}

TEST_F(PortWithAHorizon, NamesTheMotorWhoseChipHasAFault) {
  ChannelConfig gantry = config(0);
  MotorSignals& twin = gantry.twins.emplace_back();
  twin.step.line = 2;
  twin.dir.line = 3;
  twin.fault = Signal{7, true};
  make({gantry});
  for (int i = 0; i < 4; ++i) put({0, 1, kStart + i * kMillisecond});
  runUntil(kStart + kMillisecond / 2);
  lines.inputs[7] = 1;
  runUntil(kStart + 200 * kMillisecond);
  EXPECT_EQ(heard().stopped, EndReason::kChipFault);
  EXPECT_EQ(heard().motor, 1u);
}

TEST_F(PortWithAHorizon, LeavesOutAMotorThatHasReachedItsSwitchUntilTheNextMotion) {
  ChannelConfig gantry = config(0);
  gantry.endstop_max = Signal{7, true};
  gantry.max_skew = 100;
  MotorSignals& twin = gantry.twins.emplace_back();
  twin.step.line = 2;
  twin.dir.line = 3;
  twin.endstop_max = Signal{8, true};
  make({gantry});
  port().begin(0, {0, true, true});
  for (int i = 0; i < 10; ++i) put({0, 1, kStart + i * kMillisecond});
  runUntil(kStart + 2 * kMillisecond + kMillisecond / 2);
  lines.inputs[7] = 1;
  runUntil(kStart + 5 * kMillisecond + kMillisecond / 2);
  lines.inputs[8] = 1;
  runUntil(kStart + 200 * kMillisecond);
  EXPECT_EQ(risesOf(gantry), 3);
  EXPECT_EQ(risesOf(twin), 6);
  EXPECT_EQ(heard().stopped, EndReason::kEndstopMax);
  EXPECT_EQ(heard().still, (std::vector<MotorSet>{0, 0, 0, motorBit(0), motorBit(0), motorBit(0)}));
  lines.inputs[7] = lines.inputs[8] = 0;
  port().begin(0, {});
  put({0, 1, clock.now() + kMillisecond});
  runUntil(clock.now() + 200 * kMillisecond);
  EXPECT_EQ(risesOf(gantry), 4);
  EXPECT_EQ(risesOf(twin), 7);
}

TEST_F(PortWithAHorizon, AccountsForStepsThatGoOutWhileTheyAreTakenBack) {
  make({config(0)});
  board = std::make_unique<Punctual>(lines, clock, configs, 5 * kMillisecond);
  port().listen(*ear);
  for (int i = 0; i < 20; ++i) put({0, 1, kStart + i * kMillisecond});
  runUntil(kStart + 3 * kMillisecond + kMillisecond / 2);
  EXPECT_EQ(heard().played, 4u);
  port().takeBack(0);
  runUntil(kStart + 200 * kMillisecond);
  EXPECT_EQ(heard().played, 9u);
  EXPECT_EQ(heard().given_back, 11u);
  EXPECT_EQ(risesOf(configs[0]), 9);
}

// The board plays in a thread of its own against a real clock; what it plays, the engine's thread
// hears in serve(), and no step is lost or doubled between them.
TEST(PortInAnotherThread, AccountsForEachStep) {
  SteadyClock clock;
  VirtualClock unused;
  test::RecordingLines lines(unused);  // only the board's thread writes
  ChannelConfig config;
  config.step.line = 0;
  config.dir.line = 1;
  test::AheadPort port(lines, clock, {config}, {});
  Ear ear(1);
  port.listen(ear);
  std::atomic<bool> over{false};
  std::thread board([&] {
    while (!over) port.play(clock.now());
  });

  constexpr std::size_t kSteps = 2'000;
  const Nanoseconds begin = clock.now() + kMillisecond;
  for (std::size_t i = 0; i < kSteps; ++i) {
    port.put({0, i % 3 == 2 ? -1 : 1, begin + static_cast<Nanoseconds>(i) * 10'000});
    port.serve(clock.now());
    if (i == kSteps / 2) port.takeBack(0);
  }
  const Nanoseconds end = clock.now() + 60'000 * kMillisecond;
  while (ear.heard[0].played + ear.heard[0].given_back < kSteps && clock.now() < end) {
    clock.waitUntil(clock.now() + kMillisecond);
    port.serve(clock.now());
  }
  over = true;
  board.join();
  EXPECT_EQ(ear.heard[0].played + ear.heard[0].given_back, kSteps);
  EXPECT_EQ(lines.rises(0).size(), ear.heard[0].played);
}

}  // namespace
}  // namespace stepdriver::pulse
