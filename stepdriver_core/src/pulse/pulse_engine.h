#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "pulse/channel.h"
#include "pulse/command.h"
#include "pulse/due_tree.h"
#include "pulse/lateness_record.h"
#include "pulse/mailbox.h"
#include "pulse/snapshot.h"
#include "pulse/stop_counts.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// What the engine has done since the start, whole and from one instant.
struct EngineState {
  std::uint64_t pulses = 0;
  std::uint64_t slips = 0;  ///< times that the timeline was slid, for one instant's edges once
  Nanoseconds slipped = 0;  ///< by how much altogether: motion time is clock time less this
  Nanoseconds worst_lateness = 0;  ///< of an active STEP edge against its planned time
};

struct EngineChannel;

/// Is told that the engine has something new for whoever gives it orders: an order was taken or
/// refused, a motion has ended, a chip has reported a fault, an emergency stop was served.
class NewsListener {
 public:
  virtual ~NewsListener() = default;

  /// From the thread that serves the engine, after the pass, once for all that came in it. What is
  /// new is read from channel() and stopsServed(). It must not throw, wait or allocate.
  virtual void onNews() noexcept = 0;
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
  ~PulseEngine();
  PulseEngine(const PulseEngine&) = delete;
  PulseEngine& operator=(const PulseEngine&) = delete;

  /// Of the planned interval: a late step leaves the next one so much of it at least.
  static constexpr double kClosest = 0.75;

  /// Does what is due. @return the clock time at which it wants to be called again, which may be
  ///   past.
  Nanoseconds serve();

  /// @return false where the mailbox is full.
  bool post(const Command& command);

  /// Some input may have changed: the engine reads what matters and acts on it. It may be told too
  /// often; what it isn't told of it sees before the next step, where that depends on it.
  void inputsChanged();

  /// @name Emergency stops
  /// No motion is followed while more were asked for than cleared, see StopCounts.
  /// @{

  /// Lets the pulse that is out finish and sends no other, on any channel, until it is cleared.
  ///
  /// @return the count of stops asked for, with this one.
  std::uint64_t emergencyStop();
  std::uint64_t stopsAsked() const { return stops_.asked(); }
  std::uint64_t stopsServed() const { return stops_.served(); }
  /// @param served a count that stopsServed() has given: all up to that are over.
  void clearEmergencyStop(std::uint64_t served) { stops_.clear(served); }
  bool emergencyStopped() const { return stops_.stopped(); }

  /// Times that the emergency-stop input asked for a stop.
  std::uint64_t inputStops() const { return input_stops_.load(std::memory_order_acquire); }
  /// @}

  /// @param listener outlives the engine; set before the first serve().
  void listen(NewsListener& listener) { listener_ = &listener; }

  /// What a channel does, whole and from one instant.
  ChannelState channel(int index) const;
  EngineState state() const { return figures_.load(); }

  /// How late active STEP edges were against their planned times.
  LatenessFigures lateness() const { return lateness_.sinceStart(); }
  LatenessFigures latenessLastSecond() const { return lateness_.lastSecond(clock_.now()); }

  std::size_t channels() const;

 private:
  using Channel = EngineChannel;

  // Orders.
  void takeMail(Nanoseconds now);
  void takeCommand(const Command& command, Nanoseconds now);
  void followAll(const Command& command, Nanoseconds now);
  bool mayFollow(const Follow& order, Nanoseconds now) const;

  // News.
  void tell();

  // Inputs and emergency stops.
  void serveStops();
  void stopAll(Nanoseconds now);
  void readInputs(Nanoseconds now);
  void readEmergencyStop();
  void readFault(Channel& channel, Nanoseconds now);
  bool mayStep(Channel& channel, Nanoseconds now);

  // Edges.
  void collectDue(Nanoseconds now);
  bool meetLateness(Nanoseconds now);
  void writeSteps(Nanoseconds now);
  void dropEnded();
  void writeOneByOne(int error, Nanoseconds now);
  void written(Channel& channel, Nanoseconds now);
  void writeOthers(Nanoseconds now);
  void turn(Channel& channel, Nanoseconds now);
  void fail(Channel& channel, const LineFailure& failure, Nanoseconds now);
  void end(Channel& channel, EndReason reason, Nanoseconds now);
  void endOne(Channel& channel, EndReason reason, Nanoseconds now);

  // Times.
  void changed(Channel& channel);
  void scheduleChanged();
  void scheduleAll();
  bool schedule(Channel& channel);
  bool scheduleRise(Channel& channel);
  static Nanoseconds closestRise(const Channel& channel);
  bool slideUpTo(Nanoseconds earliest, Nanoseconds planned);
  void slide(Nanoseconds by);

  gpio::Lines& lines_;
  Clock& clock_;
  const Nanoseconds max_lateness_;
  const std::optional<Signal> emergency_input_;
  bool emergency_input_active_ = false;  // as it read last
  std::vector<Channel> channels_;
  DueTree dues_;
  // Of one pass: who is due, who is to be scheduled, and the writes with who they are for.
  std::vector<std::size_t> due_;
  std::vector<Channel*> changed_;
  std::vector<gpio::LineWrite> writes_;
  std::vector<Channel*> writers_;
  std::vector<int> errors_;
  bool slid_ = false;
  Mailbox<Command, 64> mail_;

  StopCounts stops_;
  std::atomic<std::uint64_t> input_stops_{0};
  NewsListener* listener_ = nullptr;
  bool news_ = false;  // of this pass
  std::atomic<bool> inputs_changed_{false};
  EngineState state_;
  LatenessRecord lateness_;
  Snapshot<EngineState> figures_;
};

}  // namespace stepdriver::pulse
