#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "channel/channel_config.h"
#include "channel/channel_state.h"
#include "channel/watched_lines.h"
#include "port/pin_ring.h"
#include "port/step_port.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Steps of motors whose coils are switched by lines (ChannelConfig::patterns). A step is one write
/// of the coils that change: it has no pulse that must end, and no DIR that must turn. Steps of one
/// instant go out in one write. What was put is played in the next serve().
///
/// From one half step to the next, a single line changes, so no write can leave another pattern. A
/// full step switches one coil off and the next one on; a kernel driver may do that in any order,
/// because both patterns between have the field of the half step between.
class CoilPort final : public StepPort {
 public:
  /// @param channels those without patterns aren't played. @param lines, clock outlive this. Lines
  ///   of coils are off.
  CoilPort(WatchedLines& lines, Clock& clock, std::vector<ChannelConfig> channels);

  Nanoseconds horizon() const override { return 0; }
  void aim(std::size_t /*channel*/, int /*direction*/) override {}
  void put(const Step& step) override;
  void takeBack(std::size_t channel) override;
  void serve(Nanoseconds now) override;
  LineFailure setCurrent(std::size_t channel, const CoilCurrent& current) override;
  void recordTo(PinRing& ring) override { ring_ = &ring; }

 private:
  using Places = std::array<std::uint8_t, kMostMotors>;

  const MotorSignals& motorOf(std::size_t channel, std::size_t motor) const {
    const ChannelConfig& config = configs_[channel];
    return motor == 0 ? config : config.twins[motor - 1];
  }
  std::size_t motorsOf(std::size_t channel) const { return 1 + configs_[channel].twins.size(); }
  std::uint8_t nextPlace(const Step& step, std::size_t motor) const;
  void collectWrites(const Step& step);
  void playEach(Nanoseconds now);
  LineFailure writeEach(std::size_t first, std::size_t size);
  void record(std::size_t first, std::size_t size, Nanoseconds done);
  void played(const Step& step, Nanoseconds done);
  void stepAt(std::size_t channel, Nanoseconds done);

  WatchedLines& lines_;
  Clock& clock_;
  PinRing* ring_ = nullptr;
  const std::vector<ChannelConfig> configs_;
  std::vector<Places> places_;     // the numbers of the patterns of each channel's motors
  std::vector<Step> puts_;         // steps that haven't been played
  std::vector<Step> playing_;      // those that are being written
  std::vector<std::size_t> ends_;  // where the writes of each of them end in writes_
  std::vector<std::pair<std::size_t, LineFailure>> failures_;  // by channel
  std::vector<gpio::LineWrite> writes_;                        // those of one call of serve()
};

}  // namespace stepdriver::pulse
