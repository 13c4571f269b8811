#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "channel/channel_config.h"
#include "port/pulse_train.h"
#include "port/step_port.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::test {

/// A port that plays steps ahead of time, as a board with firmware of its own does: it takes them
/// long before their times, plays them early or late by its own clock, watches the switches itself,
/// and gives steps back only when it gets round to it.
///
/// The board's side is play(), which a test calls when it likes, from any thread. It has the chips'
/// times and the conditions of the ChannelConfig.
class AheadPort final : public pulse::StepPort {
 public:
  using Nanoseconds = pulse::Nanoseconds;

  struct Habits {
    Nanoseconds horizon = 50'000'000;
    /// By how much later than its time a step is played; below 0: earlier.
    std::function<Nanoseconds(const Step& step)> late = [](const Step& /*step*/) {
      return Nanoseconds{0};
    };
  };

  /// @param lines, clock outlive this.
  AheadPort(gpio::Lines& lines, pulse::Clock& clock, std::vector<pulse::ChannelConfig> channels,
            Habits habits)
      : StepPort(channels.size()),
        lines_(lines),
        clock_(clock),
        habits_(std::move(habits)),
        configs_(std::move(channels)),
        pins_(configs_.size()) {
    for (std::size_t i = 0; i < configs_.size(); ++i) tracks_.emplace_back(configs_[i], pins_[i]);
  }

  /// @name The engine's side
  /// @{
  Nanoseconds horizon() const override { return habits_.horizon; }
  /// It turns by itself: its lanes accept either direction.
  void aim(std::size_t /*channel*/, int /*direction*/) override {}
  void put(const Step& step) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    tracks_[step.channel].open.push_back({step, step.time + habits_.late(step)});
    lanes_[step.channel].last = step.time;
    lanes_[step.channel].takes = step.time;
  }
  void takeBack(std::size_t channel) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    tracks_[channel].taken_back = !tracks_[channel].open.empty();
  }
  void serve(Nanoseconds /*now*/) override {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      telling_.swap(told_);
    }
    for (const auto& tell : telling_) tell(*listener_);
    telling_.clear();
  }
  void recordTo(pulse::PinRing& /*ring*/) override {}
  /// @}

  /// @name The board's side
  /// @{
  /// When play() has something to do.
  Nanoseconds playDue() {
    const std::lock_guard<std::mutex> lock(mutex_);
    Nanoseconds due = pulse::kNever;
    for (Track& track : tracks_) due = std::min(due, track.taken_back ? 0 : dueOf(track));
    return due;
  }
  /// Plays what is due, and gives back what was taken back.
  void play(Nanoseconds now) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::size_t before = told_.size();
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      if (tracks_[i].taken_back) giveBack(i);
      while (dueOf(tracks_[i]) <= now) playEdge(i);
    }
    if (told_.size() != before) clock_.wake();
  }
  /// @}

 private:
  struct Open {
    Step step;
    Nanoseconds plays = 0;  // by the board's clock
  };
  struct Track {
    Track(const pulse::ChannelConfig& channel_config, Lane& lane)
        : config(channel_config), pin(lane), train(channel_config, lane) {}
    const pulse::ChannelConfig& config;
    const Lane& pin;
    pulse::PulseTrain train;
    std::deque<Open> open;
    bool taken_back = false;
  };

  static Nanoseconds dueOf(const Track& track) {
    if (track.pin.busy) return track.train.fallDue();
    if (track.open.empty()) return pulse::kNever;
    if (track.pin.direction != track.open.front().step.direction) return track.train.turnDue();
    return std::max(track.open.front().plays, track.pin.takes);
  }

  void playEdge(std::size_t channel) {
    Track& track = tracks_[channel];
    if (track.pin.busy) {
      if (write(channel)) track.train.fall(clock_.now());
      return;
    }
    const Step step = track.open.front().step;
    if (track.pin.direction != step.direction) return turn(channel, step.direction);
    if (const auto reason = forbidden(track, step)) return stop(channel, *reason);
    track.train.beginPulse(step.still);
    if (!write(channel)) return;
    const Nanoseconds now = clock_.now();
    track.train.rise(now);
    track.open.pop_front();
    told_.emplace_back(
        [=](Listener& listener) { listener.played(channel, step.direction, step.still, now); });
  }

  bool write(std::size_t channel) {
    std::array<gpio::LineWrite, pulse::kMostMotors> writes{};
    const gpio::LineWrite* end = tracks_[channel].train.putEdges(writes.data());
    return writeAll(channel, writes.data(), static_cast<std::size_t>(end - writes.data()));
  }

  void turn(std::size_t channel, int direction) {
    Track& track = tracks_[channel];
    std::array<gpio::LineWrite, pulse::kMostMotors> writes{};
    for (std::size_t i = 0; i < track.train.motors(); ++i) {
      writes.at(i) = track.train.turnOf(i, direction > 0);
    }
    const bool written =
        track.train.stepsOnDir() || writeAll(channel, writes.data(), track.train.motors());
    if (written) track.train.turned(direction, clock_.now());
  }

  bool writeAll(std::size_t channel, const gpio::LineWrite* writes, std::size_t count) {
    const int error = lines_.write(writes, count);
    if (error == 0) return true;
    Track& track = tracks_[channel];
    const Nanoseconds now = clock_.now();
    const bool is_step = !track.pin.busy && !track.open.empty();
    track.train.failed(now);
    if (is_step) track.open.pop_front();  // it may have gone out
    const pulse::LineFailure failure{error, writes->output};
    told_.emplace_back([=](Listener& listener) {
      if (is_step) listener.givenBack(channel, 1);
      listener.failed(channel, failure, now);
    });
    giveBack(channel);
    return false;
  }

  // A condition of a step that isn't fulfilled.
  std::optional<std::pair<pulse::EndReason, pulse::LineFailure>> forbidden(const Track& track,
                                                                           const Step& step) {
    for (std::size_t i = 0; i < track.train.motors(); ++i) {
      const pulse::MotorSignals& motor = i == 0 ? track.config : track.config.twins[i - 1];
      const bool forward = step.direction > 0;
      const auto& endstop = forward ? motor.endstop_max : motor.endstop_min;
      const auto reason = forward ? pulse::EndReason::kEndstopMax : pulse::EndReason::kEndstopMin;
      if (endstop && (step.still & pulse::motorBit(i)) == 0) {
        const int level = lines_.read(endstop->line);
        if (level < 0) {
          return std::pair(pulse::EndReason::kLineError,
                           pulse::LineFailure{-level, endstop->line, true});
        }
        if ((level != 0) == endstop->active) return std::pair(reason, pulse::LineFailure{});
      }
      if (motor.fault && !track.config.ramps_at_fault) {
        const int level = lines_.read(motor.fault->line);
        if (level >= 0 && (level != 0) == motor.fault->active) {
          return std::pair(pulse::EndReason::kChipFault, pulse::LineFailure{});
        }
      }
    }
    return std::nullopt;
  }

  void stop(std::size_t channel, const std::pair<pulse::EndReason, pulse::LineFailure>& why) {
    giveBack(channel);
    told_.emplace_back(
        [=](Listener& listener) { listener.stopped(channel, why.first, why.second, 0); });
  }

  void giveBack(std::size_t channel) {
    Track& track = tracks_[channel];
    track.taken_back = false;
    if (track.open.empty()) return;
    told_.emplace_back([channel, steps = track.open.size()](Listener& listener) {
      listener.givenBack(channel, steps);
    });
    track.open.clear();
  }

  gpio::Lines& lines_;
  pulse::Clock& clock_;
  const Habits habits_;
  const std::vector<pulse::ChannelConfig> configs_;
  std::vector<Lane> pins_;  // as the chips see them
  std::mutex mutex_;        // for all below
  std::deque<Track> tracks_;
  std::vector<std::function<void(Listener&)>> told_;
  std::vector<std::function<void(Listener&)>> telling_;
};

}  // namespace stepdriver::test
