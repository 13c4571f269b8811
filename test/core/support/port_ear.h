#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "channel/channel_state.h"
#include "port/step_port.h"

namespace stepdriver::test {

/// Hears what becomes of the steps.
class Ear : public pulse::StepPort::Listener {
 public:
  struct Heard {
    std::int64_t count = 0;
    std::size_t played = 0;
    std::size_t given_back = 0;
    std::vector<pulse::Nanoseconds> times;
    std::vector<pulse::MotorSet> still;
    std::optional<pulse::EndReason> stopped;
    std::size_t lane = 0;   // whose input stopped it
    std::size_t motor = 0;  // of that lane
    pulse::LineFailure failure;
    bool doubtful = false;
  };

  explicit Ear(std::size_t channels) : heard(channels) {}

  void played(std::size_t channel, int direction, pulse::MotorSet still,
              pulse::Nanoseconds time) override {
    Heard& of = heard.at(channel);
    of.count += direction;
    ++of.played;
    of.times.push_back(time);
    of.still.push_back(still);
  }
  void ready(std::size_t /*channel*/) override {}
  void givenBack(std::size_t channel, std::size_t steps) override {
    heard.at(channel).given_back += steps;
  }
  void stopped(std::size_t channel, const pulse::StepPort::Stop& stop) override {
    heard.at(channel).stopped = stop.reason;
    heard.at(channel).failure = stop.failure;
    heard.at(channel).lane = stop.lane;
    heard.at(channel).motor = stop.motor;
  }
  void doubtful(std::size_t channel) override { heard.at(channel).doubtful = true; }
  void failed(std::size_t channel, const pulse::LineFailure& failure,
              pulse::Nanoseconds /*now*/) override {
    heard.at(channel).failure = failure;
  }

  std::vector<Heard> heard;
};

}  // namespace stepdriver::test
