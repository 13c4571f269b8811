#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "channel/channel_state.h"
#include "channel/watched_lines.h"
#include "port/due_tree.h"
#include "port/pin_ring.h"
#include "port/pulse_train.h"
#include "port/step_port.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Writes the edges of all channels on GPIO lines now, those of one instant in one write. What was
/// put is played in the next serve().
class GpioPort final : public StepPort {
 public:
  /// @param lines, clock outlive this. Lines of STEP and DIR are at their inactive levels.
  GpioPort(WatchedLines& lines, Clock& clock, std::vector<ChannelConfig> channels);

  Nanoseconds horizon() const override { return 0; }
  void aim(std::size_t channel, int direction) override;
  /// @pre Channels are put in ascending order between two calls of serve().
  void put(const Step& step) override {
    trains_[step.channel].beginPulse(step.still);
    puts_.push_back(step.channel);
    due_ = std::min(due_, step.time);
  }
  void takeBack(std::size_t channel) override;
  void serve(Nanoseconds now) override;
  void recordTo(PinRing& ring) override { ring_ = &ring; }

 private:
  // What became of an edge if not all of them could be written.
  struct Outcome {
    std::size_t channel = 0;
    bool first = true;     // the edge of its first motor, which stands for all
    Nanoseconds done = 0;  // clock time by which it has happened
    LineFailure failure;   // it may have happened
  };

  std::vector<std::size_t>& collectEdges(Nanoseconds now);
  void writeEdges(const std::vector<std::size_t>& edges, Nanoseconds now);
  void writeOneByOne(const std::vector<std::size_t>& edges, std::size_t size, int error,
                     Nanoseconds now);
  void written(std::size_t channel, Nanoseconds done);
  void turnDue(Nanoseconds now);
  void turn(std::size_t channel, Nanoseconds now);
  LineFailure writeTurn(std::size_t channel);
  void record(const gpio::LineWrite& write, Nanoseconds done) {
    if (ring_ != nullptr) ring_->add(write.output, write.level, done);
  }

  WatchedLines& lines_;
  Clock& clock_;
  PinRing* ring_ = nullptr;
  const std::vector<ChannelConfig> configs_;
  std::vector<PulseTrain> trains_;
  DueTree dues_;                           // when pulses and turns end
  std::size_t aims_ = 0;                   // lanes that turn
  std::vector<std::size_t> puts_;          // channels with a step that hasn't been played
  std::vector<std::size_t> due_channels_;  // in this pass
  std::vector<std::size_t> edges_;         // channels with an edge of STEP in this pass
  std::vector<gpio::LineWrite> writes_;    // in this pass
  std::vector<Outcome> outcomes_;
};

}  // namespace stepdriver::pulse
