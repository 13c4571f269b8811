#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "channel/channel_config.h"
#include "channel/channel_state.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

class PinRing;

/// How the steps of channels go out: on GPIO lines now (GpioPort), or ahead of time, by hardware
/// that plays them at their times.
///
/// A step is *put*, and the port has it then: it is *open*, until it was *played* or *given back*,
/// which the Listener is told. Nothing else may become of it, and the steps of a channel are played
/// in the order in which they were put. The position of a motor is the count of what was played;
/// what was put is where it will be if nothing comes between.
///
/// One step of a channel after the other:
///
///     if (!lane.accepts(direction)) port.aim(channel, direction);
///     // serve() until Listener::ready() says that the lane accepts it, and then:
///     port.put({channel, direction, time});  // at the clock time time - horizon(), or later
///     port.serve(now);                       // now, and whenever due() is over
///
/// Times are clock times [ns] of the engine's Clock; a port with a clock of its own converts them.
/// All functions, and the Listener's, are for the pulse thread, and none of them waits for the
/// hardware, allocates or throws; `const` functions change nothing. A port that plays in another
/// thread keeps what it has to tell until serve() is called, and wakes the clock so that it is.
class StepPort {
 public:
  /// Lanes, a bit for each: the first one's is the lowest.
  using LaneSet = std::uint64_t;
  static constexpr std::size_t kMostLanes = 64;  ///< for a port with a horizon
  static LaneSet laneBit(std::size_t lane) { return LaneSet{1} << lane; }

  /// A step of a channel.
  struct Step {
    std::size_t channel = 0;
    int direction = 0;     ///< +1 or -1
    Nanoseconds time = 0;  ///< its planned clock time
    MotorSet still = 0;    ///< motors of the channel that don't take part
    /// For ports with a horizon: the lanes of the axes that it moves towards max, and towards min.
    /// Those are the channel's own, or those of the axes that share its motor.
    /// @{
    LaneSet forward = 0;
    LaneSet backward = 0;
    /// @}
  };

  /// For ports with a horizon: how the motors of an axis make a motion, see Follow.
  struct Manner {
    MotorSet still = 0;        ///< these make no steps
    bool squares = false;      ///< each stops at its own switch, and the others continue
    bool is_square = false;    ///< their skew counts from here
    bool until_block = false;  ///< it ends when the motor is blocked
  };

  /// A condition that a step didn't fulfil.
  struct Stop {
    EndReason reason = EndReason::kDone;
    std::size_t lane = 0;   ///< the lane whose input it was
    std::size_t motor = 0;  ///< that lane's motor
    LineFailure failure;    ///< for kLineError
    MotorSet still = 0;     ///< the motors that have stopped at their own switches
  };

  /// What the engine must know of a channel to put its next step. Written by the port only, in
  /// aim(), put(), takeBack() and serve().
  struct Lane {
    bool busy = false;      ///< a pulse is out; no step is taken until it has ended
    bool stepped = false;   ///< it has played a step
    int direction = 0;      ///< the direction of the steps that it accepts: +1, -1, or 0 for either
    int aim = 0;            ///< the direction that it turns to now; 0: it isn't turning
    Nanoseconds takes = 0;  ///< the earliest time of the next step, if it isn't busy
    Nanoseconds closest = 0;  ///< the same as far as it is known while it is busy
    Nanoseconds last = 0;     ///< the time of the last step

    bool accepts(int step) const { return !busy && (direction == step || direction == 0); }
  };

  /// What becomes of the steps. All functions are called within serve().
  class Listener {
   public:
    virtual ~Listener() = default;

    /// The oldest open step of a channel has gone out on all motors but those that are still. A
    /// port with a horizon says so when its pulse has ended.
    ///
    /// @param time by which it had happened; the lane still tells of the step before it.
    virtual void played(std::size_t channel, int direction, MotorSet still, Nanoseconds time) = 0;
    /// A pulse has ended, or the lane has turned: it tells when the next step is accepted.
    virtual void ready(std::size_t channel) = 0;
    /// Open steps of a channel, the last ones that were put, will never be played.
    virtual void givenBack(std::size_t channel, std::size_t steps) = 0;
    /// A condition of the port's own has stopped the channel: no open step of it will be played,
    /// and all are given back. Only for ports with a horizon.
    virtual void stopped(std::size_t channel, const Stop& stop) = 0;
    /// Nobody knows how many of the steps that were given back have gone out: the motor's position
    /// isn't known any more. Told before stopped() or failed().
    virtual void doubtful(std::size_t /*channel*/) {}
    /// A line of a channel could not be written. A step that was to go out may have gone out, and
    /// counts as given back; or the lane hasn't turned. All steps that are still open are given
    /// back too.
    virtual void failed(std::size_t channel, const LineFailure& failure, Nanoseconds now) = 0;
  };

  StepPort() = default;
  virtual ~StepPort() = default;
  StepPort(const StepPort&) = delete;
  StepPort& operator=(const StepPort&) = delete;

  /// @param listener outlives the port; set before the first step.
  virtual void listen(Listener& listener) { listener_ = &listener; }

  virtual const Lane& lane(std::size_t channel) const { return lanes_[channel]; }
  std::size_t lanes() const { return lanes_.size(); }

  /// How long before its time a step is put, at most. Until then it isn't given back unless the
  /// motion ends at once: a profile that takes over a motion begins later than this from now. What
  /// the planner needs to make and hand over a profile comes in addition.
  ///
  /// 0: the port writes now. A step is played in the serve() after its put(), and is over then.
  /// Whoever puts it asks the guards first, so it doesn't know any.
  ///
  /// Otherwise the port keeps the guards' conditions until the step is played, and a step that one
  /// forbids stops the channel:
  /// - No step goes out while a switch of an axis in Step::forward or Step::backward is active at
  ///   that end, or can't be read.
  /// - In a motion that squares, a motor whose own switch is active becomes still instead. The
  ///   channel stops when all its motors are still, or as EndReason::kSkewed before the counts of
  ///   two get further apart than ChannelConfig::max_skew.
  /// - No step goes out to a motor whose chip's fault output is active, unless
  ///   ChannelConfig::ramps_at_fault.
  /// - In a motion that is made until a block, no step goes out once ChannelConfig::block was
  /// active
  ///   in it, for however short a time.
  /// Channels that end together with a stopped one play on until their steps are taken back.
  virtual Nanoseconds horizon() const = 0;

  /// A motion of an axis begins from rest. @pre No step of it is open.
  virtual void begin(std::size_t /*channel*/, const Manner& /*manner*/) {}

  /// The direction of the next step, if the lane doesn't accept it; 0: none is to be expected.
  /// @pre The lane isn't busy, and no step of it is open.
  virtual void aim(std::size_t channel, int direction) = 0;

  /// Hands over a step. It is played at its time, as the port's own clock has it, or as soon
  /// afterwards as the chip's times allow.
  /// @pre The lane accepts it. Its time isn't before Lane::takes, or that of the step before it.
  virtual void put(const Step& step) = 0;

  /// Drops all open steps of a channel at once, for the end of a motion, whatever its speed. A
  /// pulse that is out ends as usual. What hasn't been played is given back: by a port that writes
  /// now in this call, without a word; by others as soon as the hardware has answered, which plays
  /// what is due until then. No step of the channel may be put while one is open.
  virtual void takeBack(std::size_t channel) = 0;

  /// Switches the current of the coils of a channel whose motors have ChannelConfig::patterns.
  ///
  /// @pre No step of it is open. @return the line that failed; other lines have been written.
  virtual LineFailure setCurrent(std::size_t /*channel*/, const CoilCurrent& /*current*/) {
    return {};
  }

  /// Does what is due, and tells the listener what has happened since the last call. @param now
  ///   clock time.
  virtual void serve(Nanoseconds now) = 0;

  /// The clock time at which serve() must be called again, if no step is put and the clock isn't
  /// woken before.
  Nanoseconds due() const { return due_; }

  /// @param ring records the edges that the port itself writes, each at the end of its write. It
  ///   outlives the port.
  virtual void recordTo(PinRing& ring) = 0;

 protected:
  explicit StepPort(std::size_t channels) : lanes_(channels) {}

  std::vector<Lane> lanes_;
  Listener* listener_ = nullptr;
  Nanoseconds due_ = kNever;
};

}  // namespace stepdriver::pulse
