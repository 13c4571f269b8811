#include "port/coil_port.h"

#include <algorithm>
#include <utility>

namespace stepdriver::pulse {

CoilPort::CoilPort(WatchedLines& lines, Clock& clock, std::vector<ChannelConfig> channels)
    : StepPort(channels.size()),
      lines_(lines),
      clock_(clock),
      configs_(std::move(channels)),
      places_(configs_.size()) {
  puts_.reserve(configs_.size());
  playing_.reserve(configs_.size());
  failures_.reserve(configs_.size());
  ends_.reserve(configs_.size());
  writes_.reserve(configs_.size() * kMostMotors * kCoils);
}

void CoilPort::put(const Step& step) {
  puts_.push_back(step);
  due_ = std::min(due_, step.time);
}

void CoilPort::takeBack(std::size_t channel) {
  puts_.erase(std::remove_if(puts_.begin(), puts_.end(),
                             [channel](const Step& step) { return step.channel == channel; }),
              puts_.end());
}

std::uint8_t CoilPort::nextPlace(const Step& step, std::size_t motor) const {
  const std::size_t patterns = configs_[step.channel].patterns.size();
  const std::size_t by = step.direction > 0 ? 1 : patterns - 1;
  return static_cast<std::uint8_t>((places_[step.channel].at(motor) + by) % patterns);
}

// Adds the coils that a step changes: those that it switches off come first.
void CoilPort::collectWrites(const Step& step) {
  const std::vector<CoilSet>& patterns = configs_[step.channel].patterns;
  for (std::size_t motor = 0; motor < motorsOf(step.channel); ++motor) {
    if ((step.still & motorBit(motor)) != 0) continue;
    const CoilSet before = patterns[places_[step.channel].at(motor)];
    const CoilSet after = patterns[nextPlace(step, motor)];
    const auto& coils = motorOf(step.channel, motor).coils;
    for (const bool on : {false, true}) {
      const CoilSet changing = on ? after & ~before : before & ~after;
      for (std::size_t coil = 0; coil < kCoils; ++coil) {
        if ((changing & (1U << coil)) == 0) continue;
        writes_.push_back({coils.at(coil).line, coils.at(coil).active == on});
      }
    }
  }
}

void CoilPort::record(std::size_t first, std::size_t size, Nanoseconds done) {
  if (ring_ == nullptr) return;
  for (std::size_t i = first; i < size; ++i) ring_->add(writes_[i].output, writes_[i].level, done);
}

// Of a step, or of the current of a channel, whose write with others has failed: it shows which
// line fails. Lines that were written keep their levels.
LineFailure CoilPort::writeEach(std::size_t first, std::size_t size) {
  LineFailure failure;
  for (std::size_t i = first; i < size; ++i) {
    const int error = lines_.write(&writes_[i], 1);
    if (error == 0) {
      record(i, i + 1, clock_.now());
    } else if (failure.error == 0) {
      failure = {error, writes_[i].output};
    }
  }
  return failure;
}

void CoilPort::stepAt(std::size_t channel, Nanoseconds done) {
  Lane& lane = lanes_[channel];
  lane.stepped = true;
  lane.last = done;
  lane.closest = lane.takes =
      done + std::max(configs_[channel].step_high, configs_[channel].step_low);
}

void CoilPort::played(const Step& step, Nanoseconds done) {
  for (std::size_t motor = 0; motor < motorsOf(step.channel); ++motor) {
    if ((step.still & motorBit(motor)) == 0) {
      places_[step.channel].at(motor) = nextPlace(step, motor);
    }
  }
  listener_->played(step.channel, step.direction, step.still, done);
  stepAt(step.channel, done);
}

void CoilPort::serve(Nanoseconds now) {
  due_ = kNever;
  if (puts_.empty()) return;
  playing_.swap(puts_);
  writes_.clear();
  ends_.clear();
  for (const Step& step : playing_) {
    collectWrites(step);
    ends_.push_back(writes_.size());
  }
  const int error = writes_.empty() ? 0 : lines_.write(writes_.data(), writes_.size());
  const Nanoseconds done = clock_.now();
  if (error == 0) {
    record(0, writes_.size(), done);
    for (const Step& step : playing_) played(step, done);
  } else {
    playEach(now);
  }
  playing_.clear();
}

// What fails ends motions, which the steps that went out are counted before.
void CoilPort::playEach(Nanoseconds now) {
  failures_.clear();
  for (std::size_t i = 0; i < playing_.size(); ++i) {
    const std::size_t channel = playing_[i].channel;
    const LineFailure failure = writeEach(i == 0 ? 0 : ends_[i - 1], ends_[i]);
    const Nanoseconds done = clock_.now();
    if (failure.error == 0) {
      played(playing_[i], done);
    } else {
      stepAt(channel, done);
      failures_.emplace_back(channel, failure);
    }
  }
  for (const auto& [channel, failure] : failures_) listener_->failed(channel, failure, now);
}

LineFailure CoilPort::setCurrent(std::size_t channel, const CoilCurrent& current) {
  const std::vector<CoilSet>& patterns = configs_[channel].patterns;
  if (patterns.empty()) return {};
  writes_.clear();
  for (std::size_t motor = 0; motor < motorsOf(channel); ++motor) {
    places_[channel].at(motor) =
        static_cast<std::uint8_t>(current.places.at(motor) % patterns.size());
    const CoilSet on = current.on ? patterns[places_[channel].at(motor)] : CoilSet{0};
    const auto& coils = motorOf(channel, motor).coils;
    for (std::size_t coil = 0; coil < kCoils; ++coil) {
      const bool has = (on & (1U << coil)) != 0;
      writes_.push_back({coils.at(coil).line, coils.at(coil).active == has});
    }
  }
  if (lines_.write(writes_.data(), writes_.size()) != 0) return writeEach(0, writes_.size());
  record(0, writes_.size(), clock_.now());
  return {};
}

}  // namespace stepdriver::pulse
