// Steps that are patterns of coils: which lines change, in which order, and when.
#include "port/coil_port.h"

#include <gtest/gtest.h>

#include <memory>
#include <utility>
#include <vector>

#include "channel/watched_lines.h"
#include "port/line_ports.h"
#include "support/port_ear.h"
#include "support/recording_lines.h"

namespace stepdriver::pulse {
namespace {

constexpr Nanoseconds kMs = 1'000'000;

const std::vector<CoilSet> kHalf = {0b0011, 0b0010, 0b0110, 0b0100, 0b1100, 0b1000, 0b1001, 0b0001};
const std::vector<CoilSet> kFull = {0b0011, 0b0110, 0b1100, 0b1001};

ChannelConfig coils(const std::vector<CoilSet>& patterns, int first_line = 0) {
  ChannelConfig config;
  for (int i = 0; i < 4; ++i) config.coils.at(static_cast<std::size_t>(i)).line = first_line + i;
  config.patterns = patterns;
  config.step_high = config.step_low = 1'000;
  return config;
}

class CoilPortTest : public testing::Test {
 protected:
  void make(const std::vector<ChannelConfig>& channels) {
    ear = std::make_unique<test::Ear>(channels.size());
    port = makeLinePort(watched, clock, channels);
    port->listen(*ear);
  }
  void put(std::size_t channel, int direction, MotorSet still = 0) {
    clock.waitUntil(clock.now() + kMs);
    port->put({channel, direction, clock.now(), still});
    EXPECT_LE(port->due(), clock.now());
    port->serve(clock.now());
  }
  CoilSet on(int first_line = 0) {
    CoilSet set = 0;
    for (int i = 0; i < 4; ++i) {
      if (lines.levels[first_line + i]) set |= static_cast<CoilSet>(1U << i);
    }
    return set;
  }

  VirtualClock clock;
  test::RecordingLines lines{clock};
  WatchedLines watched{lines};
  std::unique_ptr<test::Ear> ear;
  std::unique_ptr<StepPort> port;
};

TEST_F(CoilPortTest, ChangesOneLineAtEachHalfStepInBothDirections) {
  make({coils(kHalf)});
  EXPECT_EQ(port->setCurrent(0, {true, {}}).error, 0);
  EXPECT_EQ(on(), 0b0011);
  std::size_t edges = lines.edges.size();
  int place = 0;
  for (const int direction : {1, 1, 1, 1, 1, 1, 1, 1, 1, -1, -1, -1, 1}) {
    EXPECT_TRUE(port->lane(0).accepts(direction)) << "nothing must turn first";
    put(0, direction);
    place = (place + direction + 8) % 8;
    EXPECT_EQ(on(), kHalf.at(static_cast<std::size_t>(place)));
    EXPECT_EQ(lines.edges.size(), ++edges);
  }
  EXPECT_EQ(ear->heard[0].count, 7);
  EXPECT_EQ(port->lane(0).takes, port->lane(0).last + 1'000);
  EXPECT_FALSE(port->lane(0).busy);
}

TEST_F(CoilPortTest, WritesBothLinesOfAFullStepAtOnce) {
  make({coils(kFull)});
  port->setCurrent(0, {true, {3}});
  EXPECT_EQ(on(), 0b1001);
  put(0, 1);
  EXPECT_EQ(on(), 0b0011);
  const std::size_t size = lines.edges.size();
  EXPECT_EQ(lines.edges[size - 1].write, lines.edges[size - 2].write);
  EXPECT_FALSE(lines.edges[size - 2].level) << "never three coils, if they are written in turn";
}

TEST_F(CoilPortTest, SwitchesAllCoilsOffAndContinuesThePattern) {
  make({coils(kHalf)});
  port->setCurrent(0, {true, {2}});
  put(0, 1);
  EXPECT_EQ(on(), 0b0100);
  port->setCurrent(0, {false, {3}});
  EXPECT_EQ(on(), 0);
  port->setCurrent(0, {true, {3}});
  put(0, -1);
  EXPECT_EQ(on(), 0b0110);
}

TEST_F(CoilPortTest, LeavesOutAMotorThatIsStill) {
  ChannelConfig gantry = coils(kHalf);
  gantry.twins.push_back(coils(kHalf, 4));
  make({gantry});
  port->setCurrent(0, {true, {}});
  put(0, 1, motorBit(0));
  EXPECT_EQ(on(), 0b0011);
  EXPECT_EQ(on(4), 0b0010);
  put(0, 1);
  EXPECT_EQ(on(), 0b0010);
  EXPECT_EQ(on(4), 0b0110);
}

TEST_F(CoilPortTest, DoesNotPlayWhatWasTakenBack) {
  make({coils(kHalf), coils(kHalf, 4)});
  port->setCurrent(0, {true, {}});
  port->setCurrent(1, {true, {}});
  port->put({0, 1, clock.now()});
  port->put({1, 1, clock.now()});
  port->takeBack(0);
  port->serve(clock.now());
  EXPECT_EQ(ear->heard[0].played, 0U);
  EXPECT_EQ(ear->heard[1].played, 1U);
  EXPECT_EQ(on(), 0b0011);
}

TEST_F(CoilPortTest, NamesTheLineThatFailsAndPlaysTheOthers) {
  make({coils(kHalf), coils(kHalf, 4)});
  port->setCurrent(0, {true, {}});
  port->setCurrent(1, {true, {}});
  lines.broken = 0;
  port->put({0, 1, clock.now()});
  port->put({1, 1, clock.now()});
  port->serve(clock.now());
  EXPECT_EQ(ear->heard[0].failure.line, 0);
  EXPECT_EQ(ear->heard[0].played, 0U);
  EXPECT_EQ(ear->heard[1].played, 1U);
  EXPECT_EQ(port->setCurrent(0, {false, {}}).line, 0);
  EXPECT_EQ(on(), 0b0001) << "what can be switched off is off";
}

TEST_F(CoilPortTest, GoesTogetherWithPulsesOnOtherChannels) {
  ChannelConfig pulses;
  pulses.step.line = 8;
  pulses.dir.line = 9;
  pulses.step_high = pulses.step_low = 2'000;
  make({pulses, coils(kHalf)});
  EXPECT_EQ(port->setCurrent(0, {true, {}}).error, 0) << "it has no coils";
  port->setCurrent(1, {true, {}});
  put(0, -1);
  put(1, 1);
  EXPECT_EQ(ear->heard[0].played, 1U);
  EXPECT_EQ(ear->heard[1].played, 1U);
  EXPECT_EQ(on(), 0b0010);
  EXPECT_FALSE(port->lane(0).accepts(1)) << "it has a DIR line";
  port->aim(0, 1);
  clock.waitUntil(port->due());
  port->serve(clock.now());
  EXPECT_TRUE(port->lane(0).accepts(1));
}

}  // namespace
}  // namespace stepdriver::pulse
