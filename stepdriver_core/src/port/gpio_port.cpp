#include "port/gpio_port.h"

#include <array>

namespace stepdriver::pulse {

GpioPort::GpioPort(WatchedLines& lines, Clock& clock, std::size_t motors)
    : lines_(lines), clock_(clock), writes_(motors), channels_(motors) {
  played_.reserve(motors);
}

bool GpioPort::play() {
  if (const int error = lines_.write(writes_.data(), size_)) {
    playOneByOne(error);
    return false;
  }
  done_ = clock_.now();
  if (ring_ != nullptr) {
    for (std::size_t i = 0; i < size_; ++i) record(writes_[i], done_);
  }
  return true;
}

// Lines that the failed write has already set keep their level.
void GpioPort::playOneByOne(int error) {
  played_.clear();
  for (std::size_t i = 0; i < size_; ++i) {
    const int its_own = size_ > 1 ? lines_.write(&writes_[i], 1) : error;
    const Nanoseconds done = clock_.now();
    if (its_own == 0) record(writes_[i], done);
    played_.push_back({channels_[i], isFirst(i), done, {its_own, writes_[i].output}});
  }
}

LineFailure GpioPort::turn(PulseTrain& train, int direction) {
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

int GpioPort::write(const gpio::LineWrite& write) {
  const int error = lines_.write(&write, 1);
  if (error == 0) record(write, clock_.now());
  return error;
}

}  // namespace stepdriver::pulse
