#pragma once

#include <cstddef>
#include <vector>

#include "channel/channel_state.h"
#include "channel/watched_lines.h"
#include "port/pin_ring.h"
#include "port/pulse_train.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Puts the edges of all channels on GPIO lines, those of one instant in one write. For the pulse
/// thread.
class GpioPort {
 public:
  /// What became of an edge if not all of them could be written.
  struct Played {
    std::size_t channel = 0;
    bool first = true;     ///< the edge of its first motor, which stands for all
    Nanoseconds done = 0;  ///< clock time by which it has happened
    LineFailure failure;   ///< it may have happened
  };

  /// @param lines, clock outlive this. @param motors of all channels.
  GpioPort(WatchedLines& lines, Clock& clock, std::size_t motors);

  /// @param ring records each edge at the end of its write, and outlives this.
  void recordTo(PinRing& ring) { ring_ = &ring; }

  /// @name Edges of STEP, together
  /// @{
  void begin() { size_ = 0; }
  /// The next edge of all motors of a channel that take part.
  ///
  /// The motors of a channel follow each other in the write. A pulse ends on each motor on which it
  /// has begun, also if one has become still meanwhile.
  void add(std::size_t channel, const PulseTrain& train) {
    for (std::size_t i = 0; i < train.motors(); ++i) {
      if (!train.hasPulsed(i)) continue;
      train.putEdge(i, writes_[size_]);
      channels_[size_++] = channel;
    }
  }
  /// Leaves out the edges of the channels for which that is true.
  template <typename Dropped>
  void drop(const Dropped& dropped);
  std::size_t size() const { return size_; }
  /// The channel of an edge.
  std::size_t channelOf(std::size_t edge) const { return channels_[edge]; }
  /// It is the edge of the first motor of its channel.
  bool isFirst(std::size_t edge) const {
    return edge == 0 || channels_[edge] != channels_[edge - 1];
  }
  /// Writes all of them; if that fails, one by one, which shows whose line fails.
  /// @return whether all have been written; then by done(). If not, played() has what became of
  /// each.
  bool play();
  Nanoseconds done() const { return done_; }
  const std::vector<Played>& played() const { return played_; }
  /// @}

  /// Sets the DIR lines of a channel, unless its steps backward have lines of their own. The edges
  /// have happened by the time that the train then has.
  LineFailure turn(PulseTrain& train, int direction);
  /// Writes another output. @return 0 or an errno.
  int write(const gpio::LineWrite& write);

 private:
  void playOneByOne(int error);
  void record(const gpio::LineWrite& write, Nanoseconds done) {
    if (ring_ != nullptr) ring_->add(write.output, write.level, done);
  }

  WatchedLines& lines_;
  Clock& clock_;
  PinRing* ring_ = nullptr;
  std::vector<gpio::LineWrite> writes_;  // the first size_ of them
  std::vector<std::size_t> channels_;    // by write
  std::size_t size_ = 0;
  std::vector<Played> played_;
  Nanoseconds done_ = 0;
};

template <typename Dropped>
void GpioPort::drop(const Dropped& dropped) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < size_; ++i) {
    if (dropped(channels_[i])) continue;
    writes_[kept] = writes_[i];
    channels_[kept++] = channels_[i];
  }
  size_ = kept;
}

}  // namespace stepdriver::pulse
