#include "port/gpio_port.h"

#include <algorithm>
#include <array>
#include <utility>

namespace stepdriver::pulse {
namespace {

std::size_t motorsOf(const std::vector<ChannelConfig>& channels) {
  std::size_t motors = channels.size();
  for (const ChannelConfig& channel : channels) motors += channel.twins.size();
  return motors;
}

}  // namespace

GpioPort::GpioPort(WatchedLines& lines, Clock& clock, std::vector<ChannelConfig> channels)
    : StepPort(channels.size()),
      lines_(lines),
      clock_(clock),
      configs_(std::move(channels)),
      dues_(configs_.size()),
      writes_(motorsOf(configs_)) {
  trains_.reserve(configs_.size());
  for (std::size_t i = 0; i < configs_.size(); ++i) trains_.emplace_back(configs_[i], lanes_[i]);
  due_channels_.reserve(configs_.size());
  puts_.reserve(configs_.size());
  edges_.reserve(configs_.size());
  outcomes_.reserve(writes_.size());
}

void GpioPort::aim(std::size_t channel, int direction) {
  aims_ = aims_ + (direction != 0 ? 1 : 0) - (lanes_[channel].aim != 0 ? 1 : 0);
  lanes_[channel].aim = direction;
  dues_.set(channel, direction == 0 ? kNever : trains_[channel].turnDue());
  due_ = dues_.earliest();
}

void GpioPort::takeBack(std::size_t channel) {
  puts_.erase(std::remove(puts_.begin(), puts_.end(), channel), puts_.end());
  if (lanes_[channel].aim != 0) aim(channel, 0);
}

// For each edge: it is compiled into its caller.
[[gnu::always_inline]] inline void GpioPort::written(std::size_t channel, Nanoseconds done) {
  PulseTrain& train = trains_[channel];
  const Lane& lane = train.lane();
  if (lane.busy) {
    train.fall(done);
    dues_.set(channel, kNever);
    return listener_->ready(channel);
  }
  listener_->played(channel, lane.direction, train.still(), done);
  train.rise(done);
  if (lane.busy) dues_.set(channel, train.fallDue());
}

// The motors of a channel follow each other in the write. A pulse ends on each motor on which it
// has begun, also if one has become still meanwhile.
[[gnu::always_inline]] inline void GpioPort::writeEdges(const std::vector<std::size_t>& edges,
                                                        Nanoseconds now) {
  gpio::LineWrite* end = writes_.data();
  for (const std::size_t channel : edges) end = trains_[channel].putEdges(end);
  const auto size = static_cast<std::size_t>(end - writes_.data());
  if (const int error = lines_.write(writes_.data(), size)) {
    return writeOneByOne(edges, size, error, now);
  }
  const Nanoseconds done = clock_.now();
  if (ring_ != nullptr) {
    for (std::size_t i = 0; i < size; ++i) record(writes_[i], done);
  }
  for (const std::size_t channel : edges) written(channel, done);
}

// The channels with the end of a pulse or a step that was put, in their order.
[[gnu::always_inline]] inline std::vector<std::size_t>& GpioPort::collectEdges(Nanoseconds now) {
  due_channels_.clear();
  dues_.collect(now, due_channels_);
  if (puts_.empty() && aims_ == 0) return due_channels_;
  edges_.clear();
  auto put = puts_.begin();
  for (const std::size_t channel : due_channels_) {
    if (!lanes_[channel].busy) continue;
    for (; put != puts_.end() && *put < channel; ++put) edges_.push_back(*put);
    edges_.push_back(channel);
  }
  edges_.insert(edges_.end(), put, puts_.end());
  puts_.clear();
  return edges_;
}

void GpioPort::serve(Nanoseconds now) {
  const bool any_due = dues_.earliest() <= now;
  std::vector<std::size_t>& edges = any_due ? collectEdges(now) : puts_;
  if (!edges.empty()) {
    writeEdges(edges, now);
    edges.clear();
  }
  if (any_due && aims_ != 0) turnDue(now);
  due_ = dues_.earliest();
}

// ---- edges of STEP ----

// It shows whose line fails. Lines that the failed write has already set keep their level. The
// count is that of the first motor of a channel, even if another's line fails.
void GpioPort::writeOneByOne(const std::vector<std::size_t>& edges, std::size_t size, int error,
                             Nanoseconds now) {
  outcomes_.clear();
  std::size_t write = 0;
  for (const std::size_t channel : edges) {
    bool first = true;
    for (std::size_t i = 0; i < trains_[channel].motors(); ++i) {
      if (!trains_[channel].hasPulsed(i)) continue;
      const gpio::LineWrite& edge = writes_[write++];
      const int its_own = size > 1 ? lines_.write(&edge, 1) : error;
      const Nanoseconds done = clock_.now();
      if (its_own == 0) record(edge, done);
      outcomes_.push_back({channel, std::exchange(first, false), done, {its_own, edge.output}});
    }
  }
  for (const Outcome& edge : outcomes_) {
    if (!edge.first) continue;
    if (edge.failure.error == 0) {
      written(edge.channel, edge.done);
    } else {
      trains_[edge.channel].failed(edge.done);
      dues_.set(edge.channel, kNever);
    }
  }
  for (const Outcome& edge : outcomes_) {
    if (edge.failure.error != 0) listener_->failed(edge.channel, edge.failure, now);
  }
}

// ---- turns ----

void GpioPort::turnDue(Nanoseconds now) {
  for (const std::size_t channel : due_channels_) {
    if (lanes_[channel].aim != 0) turn(channel, now);
  }
}

void GpioPort::turn(std::size_t channel, Nanoseconds now) {
  const LineFailure failure = writeTurn(channel);
  aim(channel, 0);
  failure.error == 0 ? listener_->ready(channel) : listener_->failed(channel, failure, now);
}

LineFailure GpioPort::writeTurn(std::size_t channel) {
  PulseTrain& train = trains_[channel];
  const int direction = lanes_[channel].aim;
  if (train.stepsOnDir()) {
    train.turned(direction, clock_.now());  // the last pulse may have ended in this pass
    return {};
  }
  std::array<gpio::LineWrite, kMostMotors> writes{};
  for (std::size_t i = 0; i < train.motors(); ++i) writes[i] = train.turnOf(i, direction > 0);
  if (const int error = lines_.write(writes.data(), train.motors())) {
    // Writing one by one shows whose line fails.
    std::size_t failing = 0;
    while (failing + 1 < train.motors() && lines_.write(&writes[failing], 1) == 0) ++failing;
    return {error, writes[failing].output};
  }
  const Nanoseconds done = clock_.now();
  train.turned(direction, done);
  for (std::size_t i = 0; i < train.motors(); ++i) record(writes[i], done);
  return {};
}

}  // namespace stepdriver::pulse
