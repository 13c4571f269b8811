#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "channel/channel_config.h"
#include "channel/channel_state.h"
#include "channel/watched_lines.h"
#include "guard/axis_guard.h"
#include "port/pulse_train.h"
#include "port/step_port.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::test {

/// A port that takes steps ahead of time, as a board with firmware of its own does: it takes them
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
    /// How long a takeBack() is on its way to the board, which plays what is due until then.
    Nanoseconds take_back = 0;
  };

  /// @param lines, clock outlive this.
  AheadPort(gpio::Lines& lines, pulse::Clock& clock, std::vector<pulse::ChannelConfig> channels,
            Habits habits)
      : StepPort(channels.size()),
        lines_(lines),
        watched_(lines),
        clock_(clock),
        habits_(std::move(habits)),
        configs_(std::move(channels)),
        pins_(configs_.size()) {
    for (std::size_t i = 0; i < configs_.size(); ++i) {
      tracks_.emplace_back(configs_[i], pins_[i], watched_);
    }
  }

  /// @name The engine's side
  /// @{
  Nanoseconds horizon() const override { return habits_.horizon; }
  /// It turns by itself: its lanes accept either direction.
  void aim(std::size_t /*channel*/, int /*direction*/) override {}
  void put(const Step& step) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    Track& track = tracks_[step.channel];
    // What was taken back before is played by now, and doesn't concern later steps.
    track.taken_back = pulse::kNever;
    track.open.push_back({step, step.time + habits_.late(step)});
    lanes_[step.channel].last = step.time;
    lanes_[step.channel].takes = step.time;
  }
  void begin(std::size_t channel, const Manner& manner) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    tracks_[channel].state.still = manner.still;
    tracks_[channel].guard.begin({manner.squares, manner.is_square, manner.until_block},
                                 clock_.now());
  }
  void takeBack(std::size_t channel) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    Track& track = tracks_[channel];
    if (track.open.empty()) return;
    track.taken_back = std::min(track.taken_back, clock_.now() + habits_.take_back);
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
    for (const Track& track : tracks_) due = std::min({due, track.taken_back, dueOf(track)});
    return due;
  }
  /// When the oldest open step was to be played; kNever: no step is open.
  Nanoseconds oldestStep() {
    const std::lock_guard<std::mutex> lock(mutex_);
    Nanoseconds oldest = pulse::kNever;
    for (const Track& track : tracks_) {
      if (!track.open.empty()) oldest = std::min(oldest, track.open.front().plays);
    }
    return oldest;
  }
  /// Plays what is due, and gives back what was taken back.
  void play(Nanoseconds now) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::size_t before = told_.size();
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      Track& track = tracks_[i];
      for (;;) {
        const Nanoseconds due = dueOf(track);
        if (track.taken_back <= std::min(now, due)) giveBack(i);
        if (dueOf(track) > now) break;
        playEdge(i);
      }
    }
    if (told_.size() != before) clock_.wake();
  }
  /// [microsteps] The steps of the channel's first motor that have gone out, of which the engine
  /// hasn't heard.
  std::int64_t untold(std::size_t channel) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return tracks_[channel].untold;
  }
  /// @}

 private:
  struct Open {
    Step step;
    Nanoseconds plays = 0;  // by the board's clock
  };
  struct Played {
    Step step;
    Nanoseconds time = 0;
  };
  struct Track {
    Track(const pulse::ChannelConfig& channel_config, Lane& lane, pulse::WatchedLines& lines)
        : config(channel_config),
          pin(lane),
          train(channel_config, lane),
          guard(channel_config, state, lines) {}
    const pulse::ChannelConfig& config;
    const Lane& pin;
    pulse::PulseTrain train;
    pulse::ChannelState state;  // as the board knows it
    pulse::AxisGuard guard;
    std::deque<Open> open;
    std::optional<Played> out;  // its pulse hasn't ended
    std::int64_t untold = 0;
    Nanoseconds taken_back = pulse::kNever;  // when that arrives
  };

  static int ownWay(const Step& step) {
    return (step.still & pulse::motorBit(0)) == 0 ? step.direction : 0;
  }

  static Nanoseconds dueOf(const Track& track) {
    if (track.pin.busy) return track.train.fallDue();
    if (track.open.empty()) return pulse::kNever;
    if (track.pin.direction != track.open.front().step.direction) return track.train.turnDue();
    return std::max(track.open.front().plays, track.pin.takes);
  }

  void playEdge(std::size_t channel) {
    Track& track = tracks_[channel];
    if (track.pin.busy) {
      if (!write(channel)) return;
      track.train.fall(clock_.now());
      return tellPlayed(channel);
    }
    Step step = track.open.front().step;
    if (track.pin.direction != step.direction) return turn(channel, step.direction);
    if (const auto reason = forbidden(channel, step)) return stop(channel, *reason);
    step.still |= track.state.still;
    track.train.beginPulse(step.still);
    if (!write(channel)) return;
    const Nanoseconds now = clock_.now();
    track.train.rise(now);
    track.open.pop_front();
    for (std::size_t i = 0; i < track.train.motors(); ++i) {
      if ((step.still & pulse::motorBit(i)) != 0) track.state.lags.at(i) -= step.direction;
    }
    track.out = Played{step, now};
    track.untold += ownWay(step);
    if (!track.pin.busy) tellPlayed(channel);
  }

  void tellPlayed(std::size_t channel) {
    if (!tracks_[channel].out) return;
    told_.emplace_back([this, channel, out = *tracks_[channel].out](Listener& listener) {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        tracks_[channel].untold -= ownWay(out.step);
      }
      listener.played(channel, out.step.direction, out.step.still, out.time);
    });
    tracks_[channel].out.reset();
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
    tellPlayed(channel);
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

  // A condition that the step doesn't fulfil.
  std::optional<Stop> forbidden(std::size_t channel, const Step& step) {
    const Track& track = tracks_[channel];
    for (std::size_t i = 0; i < track.train.motors() && !track.config.ramps_at_fault; ++i) {
      const auto& fault = i == 0 ? track.config.fault : track.config.twins[i - 1].fault;
      if (!fault) continue;
      const int level = lines_.read(fault->line);
      if (level >= 0 && (level != 0) == fault->active) {
        return Stop{pulse::EndReason::kChipFault, channel, i, {}, 0};
      }
    }
    for (std::size_t lane = 0; lane < tracks_.size(); ++lane) {
      const int forward = (step.forward & laneBit(lane)) != 0 ? 1 : 0;
      const int direction = (step.backward & laneBit(lane)) != 0 ? -1 : forward;
      if (direction == 0) continue;
      Track& axis = tracks_[lane];
      if (const auto objection = axis.guard.mayStep(direction)) {
        return Stop{objection->reason, lane, 0, objection->failure, axis.state.still};
      }
    }
    return std::nullopt;
  }

  void stop(std::size_t channel, const Stop& why) {
    giveBack(channel);
    told_.emplace_back([=](Listener& listener) { listener.stopped(channel, why); });
  }

  void giveBack(std::size_t channel) {
    Track& track = tracks_[channel];
    track.taken_back = pulse::kNever;
    if (track.open.empty()) return;
    told_.emplace_back([channel, steps = track.open.size()](Listener& listener) {
      listener.givenBack(channel, steps);
    });
    track.open.clear();
  }

  gpio::Lines& lines_;
  pulse::WatchedLines watched_;
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
