#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/motion/profile.h"
#include "stepdriver_core/motion/step_finder.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/pulse/lateness.h"
#include "stepdriver_core/pulse/mailbox.h"
#include "stepdriver_core/pulse/snapshot.h"

namespace stepdriver::pulse {

/// A line by its index in the gpio::Lines, and the level at which it does what it is named for.
struct Signal {
  int line = -1;
  bool active = true;
};

/// What the engine needs to know of an axis.
struct ChannelConfig {
  Signal step;
  Signal dir;  ///< active: forward, the count rises
  std::optional<Signal> endstop_min;
  std::optional<Signal> endstop_max;
  std::optional<Signal> fault;  ///< an input of the chip's, active: it has switched its outputs off
  Nanoseconds step_high = 0;
  Nanoseconds step_low = 0;
  Nanoseconds dir_setup = 0;
  Nanoseconds dir_hold = 0;
  Nanoseconds mode_hold = 0;
  std::int64_t backlash =
      0;  ///< microsteps that the motor makes at a reversal before the joint moves
};

/// Writes to pins other than STEP and DIR, one after the other, each with the time that must pass
/// before what comes next: the next write, or the first step.
struct PinSequence {
  struct Write {
    int line;
    bool level;
    Nanoseconds then_wait;
  };

  static constexpr std::size_t kCapacity = 8;
  std::array<Write, kCapacity> writes{};
  std::size_t size = 0;

  void add(int line, bool level, Nanoseconds then_wait) {
    writes.at(size++) = {line, level, then_wait};
  }
};

/// A profile that a channel is to follow from its start time on, instead of the one before it.
struct Follow {
  int channel = 0;
  std::uint64_t serial = 0;
  const motion::Profile* profile = nullptr;  ///< lives until the channel follows another or none
  /// Serial of the profile that this one was planned to go on from, the last one that was ordered;
  /// 0: from rest. Where the channel has ended that, it can't be taken.
  std::uint64_t continues = 0;
  /// Steps planned closer than this are at a speed that the motor can't start from or stop at
  /// without a ramp.
  Nanoseconds restart_interval = 0;
  /// Channels of one group that isn't 0 end together: what ends one of them before its time ends
  /// all others at once.
  std::uint64_t group = 0;
};

/// An order to the pulse thread. Serials rise by one on each channel.
struct Command {
  enum class Kind {
    kFollow,  ///< follow the profiles, all of them, or where one can't be taken none
    kPins,    ///< write the pins, at rest; then, where a scale is given, take that
  };

  Kind kind = Kind::kFollow;
  const Follow* follows = nullptr;  ///< of kFollow; live until the channels have taken the order
  std::size_t follow_count = 0;
  int channel = 0;  ///< of kPins, as all below
  std::uint64_t serial = 0;
  PinSequence pins;
  /// Where the motor stands then, in the microsteps of a new mode.
  struct Scale {
    std::int64_t count = 0;
    std::int64_t slack = 0;
    std::int64_t backlash = 0;
  };
  std::optional<Scale> scale;
};

enum class EndReason {
  kDone,
  kEndstopMin,
  kEndstopMax,
  kEmergencyStop,
  kChipFault,  ///< the chip's fault line became active
  kTooLate,    ///< a pulse came too late to go on at this speed
  kLineError,  ///< a line could not be written or read
  kCompanion,  ///< another channel of the group was ended
};

/// A write or a read that failed.
struct LineFailure {
  int error = 0;       ///< errno; 0: none did
  int line = -1;       ///< by its index in the gpio::Lines
  bool input = false;  ///< it was read; else it was written
};

/// What a channel does and has done.
struct ChannelState {
  std::int64_t count = 0;  ///< microsteps: active STEP edges forward less those backward
  /// Of the backlash, what is taken up towards max: from 0 to all of it. The joint stands at count
  /// less this.
  std::int64_t slack = 0;
  std::uint64_t pulses = 0;     ///< active STEP edges
  std::uint64_t taken = 0;      ///< serial of the last command that was dealt with
  std::uint64_t refused = 0;    ///< serial of the last command that came too late or found it busy
  std::uint64_t following = 0;  ///< serial of the profile under way; 0: at rest
  std::uint64_t ended = 0;      ///< serial of the last profile that ended
  EndReason end = EndReason::kDone;
  LineFailure failure;            ///< the last one
  Nanoseconds end_time = 0;       ///< motion time at which it ended
  bool end_abrupt = false;        ///< it ended at a speed that the motor can't stop from at once
  Nanoseconds end_lateness = 0;   ///< of the pulse that was not sent, for kTooLate
  std::uint64_t pins_done = 0;    ///< serial of the last kPins that was carried out
  std::uint64_t pins_failed = 0;  ///< serial of the last one that failed, with `failure`
  std::uint64_t chip_faults = 0;  ///< times that the fault line became active
  std::uint64_t line_errors = 0;  ///< failed writes and reads
  Nanoseconds ready = 0;          ///< clock time before which no step goes out
};

struct EngineState {
  std::uint64_t edges = 0;  ///< of STEP lines
  std::uint64_t pulses = 0;
  std::uint64_t slips = 0;         ///< times that the timeline was slid
  Nanoseconds slipped = 0;         ///< by how much altogether: motion time is clock time less this
  Nanoseconds worst_lateness = 0;  ///< of an active STEP edge against its planned time
};

/// Turns profiles into edges on lines, for all axes.
///
/// serve() belongs to one thread, the pulse thread. post() is for one thread at a time, all else
/// for any. Nothing in serve() allocates, locks, throws or waits; its only system calls are the
/// lines' and the clock's.
///
/// - STEP and DIR never change in one write, and no two signals of one chip whose order matters do.
/// - High, low, setup and hold times are kept from the end of the write that made the earlier edge
///   (the edge is not later than that) to the beginning of the write that makes the next.
/// - A step that comes late doesn't bring the next one closer than kClosest of their planned
///   interval; what is more than that slides the timeline of all channels (a slip).
/// - Where a write for several channels fails, those whose own lines can be written go on.
/// - Before a step towards an endstop the switch is read; none goes out while it reads active.
/// - Channels of a group start together and end together (Follow::group).
class PulseEngine {
 public:
  /// @param lines, clock outlive the engine. STEP lines are at their inactive level, DIR lines at
  ///   the inactive one too.
  /// @param emergency_stop an input that, where it becomes active or can't be read, does what
  ///   emergencyStop() does. It is read here for the first time.
  PulseEngine(gpio::Lines& lines, Clock& clock, const std::vector<ChannelConfig>& channels,
              Nanoseconds max_lateness, std::optional<Signal> emergency_stop = {});

  static constexpr double kClosest = 0.75;

  /// Does all that is due. @return the clock time at which it wants to be called again.
  Nanoseconds serve();

  /// @return false where the mailbox is full.
  bool post(const Command& command);

  /// Some input may have changed: the engine reads what matters and acts on it. It may be told too
  /// often; what it isn't told of it sees before the next step, where that depends on it.
  void inputsChanged();

  void emergencyStop();
  void clearEmergencyStop();
  bool emergencyStopped() const { return emergency_.load(std::memory_order_acquire); }

  /// Times that the emergency-stop input stopped all channels.
  std::uint64_t inputStops() const { return input_stops_.load(std::memory_order_acquire); }

  ChannelState channel(int index) const;
  EngineState state() const { return figures_.load(); }

  /// How late active STEP edges were against their planned times.
  LatenessFigures lateness() const { return lateness_.sinceStart(); }
  LatenessFigures latenessLastSecond() const { return lateness_.lastSecond(clock_.now()); }

  std::size_t channels() const { return channels_.size(); }

 private:
  /// Profiles that take over, one after the other, each at its start time. One that was planned
  /// before another has taken over goes on from that other: none may be left out.
  struct Successors {
    struct Entry {
      const motion::Profile* profile = nullptr;
      std::uint64_t serial = 0;
    };
    static constexpr std::size_t kCapacity = 16;
    std::array<Entry, kCapacity> entries{};
    std::size_t size = 0;

    bool empty() const { return size == 0; }
    /// Room for one that begins then: those that would begin no earlier have no time left.
    bool hasRoom(Nanoseconds start) const {
      return size < kCapacity || entries[size - 1].profile->startNs() >= start;
    }
    void add(const motion::Profile& profile, std::uint64_t serial);
    Entry takeFirst();
  };

  struct Channel {
    ChannelConfig config;
    ChannelState state;
    Snapshot<ChannelState> published;

    const motion::Profile* profile = nullptr;  // the one that is followed
    Successors successors;
    std::uint64_t group = 0;  // of the order that came last; 0: alone
    Nanoseconds restart_interval = 0;
    motion::StepFinder finder;
    std::optional<motion::Step> next;
    Nanoseconds last_planned = 0;  // motion time of the step before, or of the profile's start

    PinSequence pins;
    std::size_t pin = 0;
    std::uint64_t pins_serial = 0;  // of the sequence under way; 0: none
    std::optional<Command::Scale> pins_scale;
    Nanoseconds pin_due = 0;

    // Clock times by which the last edges had happened.
    Nanoseconds rose = 0;
    Nanoseconds fell = 0;
    Nanoseconds turned = 0;
    bool faulty = false;   // as the fault line read last
    bool running = false;  // the motion under way has made a step
    bool high = false;     // the pulse is out
    int direction = -1;    // as the DIR line has it
    Nanoseconds due = kNever;
  };

  /// What a channel does when it is due.
  enum class Action { kNothing, kFall, kPin, kTurn, kRise, kFinish };

  static Action actionOf(const Channel& channel);
  static bool isDue(const Channel& channel, Action action, Nanoseconds now);
  static Nanoseconds interval(const Channel& channel);
  static bool isFast(const Channel& channel);

  void takeMail(Nanoseconds now);
  void followAll(const Command& command, Nanoseconds now);
  bool mayFollow(const Follow& order, Nanoseconds now) const;
  void follow(Channel& channel, const Follow& order);
  void startPins(Channel& channel, const Command& command, Nanoseconds now);
  void adopt(Channel& channel, const motion::Profile& profile, std::uint64_t serial);
  static void pullNext(Channel& channel);

  void stopAll(Nanoseconds now);
  void readInputs(Nanoseconds now);
  void readEmergencyStop();
  void readFault(Channel& channel, Nanoseconds now);
  void meetLateness(Nanoseconds now);
  bool mayStep(Channel& channel, Nanoseconds now);
  void writeSteps(Nanoseconds now);
  void dropEnded();
  void written(Channel& channel, bool done);
  void writeOthers(Nanoseconds now);
  void turn(Channel& channel, Nanoseconds now);
  void writePin(Channel& channel, Nanoseconds now);
  static std::uint64_t latest(const Channel& channel);
  void pinsDone(Channel& channel, Nanoseconds then_wait, Nanoseconds now);
  void fail(Channel& channel, const LineFailure& failure, Nanoseconds now);
  void end(Channel& channel, EndReason reason, Nanoseconds now);
  void endOne(Channel& channel, EndReason reason, Nanoseconds now);

  void scheduleAll();
  bool schedule(Channel& channel);
  void slide(Nanoseconds by);

  gpio::Lines& lines_;
  Clock& clock_;
  const Nanoseconds max_lateness_;
  const std::optional<Signal> emergency_input_;
  bool emergency_input_active_ = false;  // as it read last
  std::vector<Channel> channels_;
  std::vector<gpio::LineWrite> writes_;  // of one pass, with the channels that they are for
  std::vector<Channel*> writers_;
  std::vector<int> errors_;
  Mailbox<Command, 64> mail_;
  std::atomic<bool> emergency_{false};
  std::atomic<std::uint64_t> input_stops_{0};
  std::atomic<bool> inputs_changed_{false};
  EngineState state_;
  LatenessRecord lateness_;
  Snapshot<EngineState> figures_;
};

}  // namespace stepdriver::pulse
