#include "port/line_ports.h"

#include <algorithm>

#include "port/coil_port.h"
#include "port/gpio_port.h"

namespace stepdriver::pulse {
namespace {

bool hasPatterns(const ChannelConfig& channel) { return !channel.patterns.empty(); }

// Two ports that write now, each with the channels of its kind.
class MixedPort final : public StepPort {
 public:
  MixedPort(WatchedLines& lines, Clock& clock, const std::vector<ChannelConfig>& channels)
      : StepPort(channels.size()), pulses_(lines, clock, channels), coils_(lines, clock, channels) {
    for (const ChannelConfig& channel : channels) {
      ports_.push_back(hasPatterns(channel) ? static_cast<StepPort*>(&coils_) : &pulses_);
    }
  }

  void listen(Listener& listener) override {
    pulses_.listen(listener);
    coils_.listen(listener);
  }
  const Lane& lane(std::size_t channel) const override { return ports_[channel]->lane(channel); }
  Nanoseconds horizon() const override { return 0; }
  void aim(std::size_t channel, int direction) override {
    ports_[channel]->aim(channel, direction);
    noteDue();
  }
  void put(const Step& step) override {
    ports_[step.channel]->put(step);
    noteDue();
  }
  void takeBack(std::size_t channel) override {
    ports_[channel]->takeBack(channel);
    noteDue();
  }
  void serve(Nanoseconds now) override {
    pulses_.serve(now);
    coils_.serve(now);
    noteDue();
  }
  LineFailure setCurrent(std::size_t channel, const CoilCurrent& current) override {
    return ports_[channel]->setCurrent(channel, current);
  }
  void recordTo(PinRing& ring) override {
    pulses_.recordTo(ring);
    coils_.recordTo(ring);
  }

 private:
  void noteDue() { due_ = std::min(pulses_.due(), coils_.due()); }

  GpioPort pulses_;
  CoilPort coils_;
  std::vector<StepPort*> ports_;  // by channel
};

}  // namespace

std::unique_ptr<StepPort> makeLinePort(WatchedLines& lines, Clock& clock,
                                       const std::vector<ChannelConfig>& channels) {
  if (std::none_of(channels.begin(), channels.end(), hasPatterns)) {
    return std::make_unique<GpioPort>(lines, clock, channels);
  }
  return std::make_unique<MixedPort>(lines, clock, channels);
}

}  // namespace stepdriver::pulse
