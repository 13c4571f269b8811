#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "plan_from_rest.h"
#include "pulse/pulse_engine.h"
#include "recording_lines.h"

namespace stepdriver::pulse {

constexpr int kLinesPerChannel = 2;  // STEP and DIR

using test::Edge;
using test::RecordingLines;

/// An engine on a virtual clock, with lines that remember what was written.
class PulseEngineTest : public testing::Test {
 protected:
  static ChannelConfig config(int channel) {
    ChannelConfig config;
    config.step.line = channel * kLinesPerChannel;
    config.dir.line = channel * kLinesPerChannel + 1;
    config.step_high = 1'900;
    config.step_low = 2'100;
    config.dir_setup = 650;
    config.dir_hold = 700;
    return config;
  }

  void make(const std::vector<ChannelConfig>& channels, Nanoseconds max_lateness = 5'000'000) {
    engine = std::make_unique<PulseEngine>(lines, clock, channels, max_lateness);
  }

  /// @param continues serial of the profile that this one continues.
  std::uint64_t follow(motion::Profile profile, int channel = 0, std::uint64_t continues = 0) {
    plan(std::move(profile), channel, continues);
    postFollows(1);
    return serial;
  }

  // Adds the same to `follows`, for postFollows().
  Follow& plan(motion::Profile profile, int channel = 0, std::uint64_t continues = 0) {
    profiles.push_back(std::make_unique<motion::Profile>(std::move(profile)));
    Follow& order = follows.emplace_back();
    order.channel = channel;
    order.serial = ++serial;
    order.profile = profiles.back().get();
    order.continues = continues;
    order.restart_interval = restart_interval;
    order.full_step = full_step;
    order.stops = engine->stopsServed();
    order.faults = engine->channel(channel).faults();
    return order;
  }

  // Puts the last elements of `follows`, this many, into one order.
  void postFollows(std::size_t count) {
    Command command;
    command.follows = &follows[follows.size() - count];
    command.follow_count = count;
    EXPECT_TRUE(engine->post(command));
  }

  // Serves until nothing is left to do, each time `late` after the due time.
  void runOut(Nanoseconds late = 0) {
    for (Nanoseconds due = engine->serve(); due != kNever; due = engine->serve()) {
      while (clock.now() < due + late) clock.waitUntil(due + late);
    }
  }

  void runUntil(Nanoseconds time) {
    for (Nanoseconds due = engine->serve(); due <= time; due = engine->serve()) {
      while (clock.now() < due) clock.waitUntil(due);
    }
    while (clock.now() < time) clock.waitUntil(time);
  }

  // Compares the edges of the first channel with the chip's times.
  void expectTimes(const ChannelConfig& channel) {
    std::optional<Nanoseconds> rose;
    std::optional<Nanoseconds> turned;
    std::optional<Nanoseconds> fell;
    std::size_t last_write = 0;
    for (const Edge& edge : lines.edges) {
      const auto since = [&edge](const std::optional<Nanoseconds>& time) {
        return time ? edge.time - *time : kNever;
      };
      SCOPED_TRACE(testing::Message() << "line " << edge.line << " at " << edge.time);
      EXPECT_NE(edge.write, last_write) << "STEP and DIR in one write";
      last_write = edge.write;
      if (edge.line == 1) {
        EXPECT_GE(since(rose), channel.dir_hold);
        turned = edge.time;
      } else if (edge.level) {
        EXPECT_GE(since(fell), channel.step_low);
        EXPECT_GE(since(turned), channel.dir_setup);
        rose = edge.time;
      } else {
        EXPECT_GE(since(rose), channel.step_high);
        fell = edge.time;
      }
    }
  }

  static motion::Profile cruise(Nanoseconds start, std::int64_t from, std::int64_t to,
                                double speed) {
    return motion::planFromRest(start, from, to, {speed, speed, 1.0, 1.0});
  }

  VirtualClock clock;
  RecordingLines lines{clock};
  std::unique_ptr<PulseEngine> engine;
  std::vector<std::unique_ptr<motion::Profile>> profiles;
  std::deque<Follow> follows;
  std::uint64_t serial = 0;
  Nanoseconds restart_interval = 0;
  int full_step = 0;
};

}  // namespace stepdriver::pulse
