#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "channel/channel_config.h"
#include "channel/channel_state.h"
#include "channel/output_line.h"
#include "channel/watched_lines.h"
#include "guard/emergency_stops.h"
#include "port/due_tree.h"
#include "port/step_port.h"
#include "pulse/command.h"
#include "pulse/heartbeat.h"
#include "pulse/lateness_record.h"
#include "pulse/mailbox.h"
#include "pulse/snapshot.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// What the engine has done since the start, consistent and from one instant.
struct EngineState {
  std::uint64_t pulses = 0;
  std::uint64_t slips = 0;         ///< how often the timeline slid; edges of one instant count once
  Nanoseconds slipped = 0;         ///< total of the slips: motion time is clock time minus this
  Nanoseconds worst_lateness = 0;  ///< the latest active STEP edge against its planned time
};

struct EngineChannel;
class EngineOutput;
struct Objection;
class Follower;
class PinRing;
class Kin;

/// Is told when the engine has news for the controller: an order was accepted or refused, a motion
/// has ended, a chip has reported a fault, or an emergency stop was served.
class NewsListener {
 public:
  virtual ~NewsListener() = default;

  /// Called by the thread that serves the engine, once after each pass that brought news, which
  /// channel() and stopsServed() contain. It must not throw, wait or allocate.
  virtual void onNews() noexcept = 0;
};

/// Turns profiles into edges on lines, for all axes. It asks three rooms: what comes next, and when
/// (Follower)? May it go out (EmergencyStops, AxisGuard)? How does it go out (StepPort)? Itself it
/// says when a step is put, how lateness is met, and what ends together.
///
/// Only the pulse thread calls serve(). post() is for one thread at a time, all other functions are
/// for any thread. Nothing in serve() allocates, locks, throws or waits; its only system calls are
/// those for the lines and the clock.
///
/// - STEP and DIR never change in one write, nor do any other signals of one chip whose order
///   matters.
/// - High, low, setup and hold times are kept from the end of the write that made the earlier edge
///   (the edge is not later than that) to the beginning of the write that makes the next.
/// - A step may be late by a part of a full step of its motor (ChannelConfig::late_steps,
///   Follow::full_step). The steps that are overdue then follow as closely as the chip's times
///   allow, until the plan is reached. Only what is beyond that slides the timeline of all channels
///   (a slip). This is so in the middle of a motion in one direction. For the first step of a
///   motion, for one after a turn, and without a full step, a quarter of an interval is absorbed,
///   and the next step follows no sooner than Follower::kClosest of their planned interval.
/// - If a write for several channels fails, those whose own lines can be written continue.
/// - The switch is read before each step towards an endstop; no step goes out while it reads
///   active.
/// - Channels of a group start together and end together (Follow::group).
class PulseEngine : private StepPort::Listener {
 public:
  /// @param lines, clock outlive the engine. STEP and DIR lines are at their inactive levels.
  /// @param emergency_stop an input that has the same effect as emergencyStop() if it becomes
  ///   active or can't be read. It is read here for the first time.
  /// @param shared channels that share motors; each channel is in at most one of them.
  PulseEngine(gpio::Lines& lines, Clock& clock, const std::vector<ChannelConfig>& channels,
              Nanoseconds max_lateness, std::optional<Signal> emergency_stop = {},
              const std::vector<SharedAxes>& shared = {});
  /// The same with a port of another kind for the steps, made for lanesOf() the channels. It
  /// outlives the engine, which reads the other lines itself.
  PulseEngine(StepPort& port, gpio::Lines& lines, Clock& clock,
              const std::vector<ChannelConfig>& channels, Nanoseconds max_lateness,
              std::optional<Signal> emergency_stop = {},
              const std::vector<SharedAxes>& shared = {});
  /// The channels of a port. Those of the axes come first, then those of the motors that axes
  /// share.
  static std::vector<ChannelConfig> lanesOf(std::vector<ChannelConfig> channels,
                                            const std::vector<SharedAxes>& shared);
  ~PulseEngine() override;
  PulseEngine(const PulseEngine&) = delete;
  PulseEngine& operator=(const PulseEngine&) = delete;

  /// Does what is due. @return the clock time at which it must be called again, which may be in the
  /// past.
  Nanoseconds serve();

  /// @return false if the mailbox is full.
  bool post(const Command& command);

  /// Some input may have changed: the engine reads the relevant ones and acts on them. Extra calls
  /// do no harm. A change without a call is seen before the next step that depends on it.
  void inputsChanged();
  /// An input has changed. From any thread, before inputsChanged().
  /// @param time clock time of the edge.
  void noteEdge(int input, bool level, Nanoseconds time);

  /// @name Emergency stops
  /// No motion is followed while more were requested than cleared, see StopCounts.
  /// @{

  /// Lets the current pulses finish and sends no more, on any channel, until it is cleared.
  ///
  /// @return the count of requested stops, including this one.
  std::uint64_t emergencyStop();
  /// The same, and ends a ramp. @return as above
  std::uint64_t stopAtOnce();
  /// Emergency stops let the axes decelerate first, but not for longer than this. The listener must
  /// order that: a channel that has no order for it (Follow::slows) by EmergencyStops::kRampBegins
  /// is stopped at once, like each channel after this time or at another call of emergencyStop().
  /// The input ends no ramp, because its contacts bounce. Set before the first serve().
  void rampStops(Nanoseconds longest) {
    // An order to decelerate can't begin before the port's horizon.
    stops_.rampStops(longest > 0 ? longest + horizon_ : 0);
  }
  /// The count of requested stops when the last ramp began.
  std::uint64_t stopsRamping() const { return stops_.ramping(); }
  std::uint64_t stopsAsked() const { return stops_.asked(); }
  std::uint64_t stopsServed() const { return stops_.served(); }
  /// @param served a count that stopsServed() has returned: all stops up to it are cleared.
  void clearEmergencyStop(std::uint64_t served) { stops_.clear(served); }
  bool emergencyStopped() const { return stops_.stopped(); }

  /// How often the emergency-stop input requested a stop.
  std::uint64_t inputStops() const { return stops_.inputStops(); }
  /// @}

  /// @param listener outlives the engine; set before the first serve().
  void listen(NewsListener& listener) { listener_ = &listener; }

  /// @param line changes its level in serve(), after the edges of the axes, at its rate. If it
  ///   can't be written, that is a failure of every channel. Set before the first serve().
  void beat(const HeartbeatLine& line) { heartbeat_.emplace(line, clock_.now()); }

  /// @param outputs can be switched by the marks of paths (FollowMarks) and by the positions of
  ///   axes (Compare), by their index here: the pulse thread writes each mark at its time, after
  ///   the steps of that time. What ends the motions of a group early ends its marks, and an
  ///   emergency stop ends all of them; positions only count from then on, until the next order.
  ///   Set before the first serve().
  void switchOutputs(const std::vector<OutputLine>& outputs);
  /// The state of one of them, consistent and from one instant.
  OutputLineState output(std::size_t index) const;
  std::size_t outputs() const;

  /// @param ring records each edge of STEP, DIR and heartbeat lines at the end of its write. It
  ///   outlives the engine; set before the first serve().
  void recordTo(PinRing& ring);

  /// The state of a channel, consistent and from one instant.
  ChannelState channel(int index) const;
  EngineState state() const { return figures_.load(); }

  /// A line for which serve() waits now, or has waited last: if that doesn't return, its chip
  /// doesn't answer. The error is ETIMEDOUT.
  LineFailure lineAtWork() const { return lines_.atWork(); }

  /// The lateness of active STEP edges, relative to their planned times.
  LatenessFigures lateness() const { return lateness_.sinceStart(); }
  LatenessFigures latenessLastSecond() const { return lateness_.lastSecond(clock_.now()); }

  std::size_t channels() const;
  /// The port's horizon: a profile is refused if it begins sooner than this from now.
  Nanoseconds horizon() const { return horizon_; }

 private:
  using Channel = EngineChannel;

  PulseEngine(StepPort* port, gpio::Lines& lines, Clock& clock,
              const std::vector<ChannelConfig>& channels, Nanoseconds max_lateness,
              std::optional<Signal> emergency_stop, const std::vector<SharedAxes>& shared);

  void add(std::size_t index, const ChannelConfig& config, Follower& follower, Kin& kin);
  std::size_t addShared(const SharedAxes& shared, const std::vector<ChannelConfig>& configs,
                        std::size_t motor);

  // Orders.
  void takeMail(Nanoseconds now);
  void takeCommand(const Command& command, Nanoseconds now);
  void followAll(const Command& command, Nanoseconds now);
  bool mayFollow(const Follow& order, Nanoseconds now) const;

  // Outputs.
  void takeCompare(const Compare& order, Nanoseconds now);
  void setCurrent(EngineChannel& channel, const CoilCurrent& current, Nanoseconds now);
  bool outputsHaveRoom(const Follow& order) const;
  Nanoseconds serveOutputs(Nanoseconds now);
  void endMarks();
  void endMarksOf(std::uint64_t group);

  // News.
  void report();

  // Inputs and emergency stops.
  void serveStops();
  void stopAll(Nanoseconds now);
  bool allSlow() const;
  void readInputs(Nanoseconds now);
  void readEmergencyStop();
  void readFaults(Channel& channel, Nanoseconds now);
  bool mayStep(Channel& channel, Nanoseconds now);
  bool askGuards(Channel& channel, Nanoseconds now);

  // Steps.
  void collectDue(Nanoseconds now);
  bool meetLateness(Nanoseconds now);
  void putSteps(Nanoseconds now);
  void servePort(Nanoseconds now);
  void fillPort(Nanoseconds now);
  void putAhead(Channel& channel, StepPort::Step& step);
  void closed(Channel& channel, std::size_t steps);
  void tellFollowed(Nanoseconds now);
  Nanoseconds tellDue() const;
  void finishDue(Nanoseconds now);
  void writeHeartbeat(Nanoseconds now);
  void finish(Channel& channel, Nanoseconds now);

  // What the port tells.
  void played(std::size_t channel, int direction, MotorSet still, Nanoseconds time) override;
  void ready(std::size_t channel) override;
  void givenBack(std::size_t channel, std::size_t steps) override;
  void stopped(std::size_t channel, const StepPort::Stop& stop) override;
  void doubtful(std::size_t channel) override;
  void failed(std::size_t channel, const LineFailure& failure, Nanoseconds now) override;

  // Ends.
  void object(Channel& channel, const Objection& objection, Nanoseconds now);
  void fail(Channel& channel, const LineFailure& failure, Nanoseconds now);
  void end(Channel& channel, EndReason reason, Nanoseconds now);
  void endEarly(Channel& channel, EndReason reason, Nanoseconds now);
  void concludeEnd(Kin& kin);
  void endOne(Channel& channel, EndReason reason, bool abrupt, Nanoseconds now);

  // Times.
  void changed(Channel& channel);
  void scheduleChanged();
  void scheduleAll();
  void schedule(Channel& channel);
  void scheduleStep(Channel& channel);
  void aim(Channel& channel, int direction);
  Nanoseconds endOf(const Channel& channel) const;
  static Nanoseconds closestStep(const Channel& channel);
  void slideFor(const Channel& channel, Nanoseconds earliest);
  void slideAt(const Channel& channel, Nanoseconds motion_then);
  void slide(Nanoseconds by);

  WatchedLines lines_;
  Clock& clock_;
  std::unique_ptr<StepPort> own_port_;
  StepPort& port_;
  const Nanoseconds horizon_;
  PinRing* ring_ = nullptr;
  const Nanoseconds max_lateness_;
  const std::optional<Signal> emergency_input_;
  const std::size_t axes_;
  std::vector<std::unique_ptr<Kin>> kins_;
  std::vector<std::unique_ptr<Follower>> followers_;  // axes with motors of their own have one
  std::vector<std::unique_ptr<Channel>>
      channels_;  // the axes' come first, then those of shared motors
  DueTree dues_;
  std::vector<std::unique_ptr<EngineOutput>> outputs_;
  // The channels that are due in this pass, and those that it must schedule.
  std::vector<std::size_t> due_;
  std::vector<Channel*> changed_;
  std::uint64_t puts_ = 0;  // steps that were put ahead of time
  bool slid_ = false;
  bool outdated_ = false;  // the timeline has slid since all channels were scheduled
  Mailbox<Command, 64> mail_;

  EmergencyStops stops_;
  NewsListener* listener_ = nullptr;
  std::optional<Heartbeat> heartbeat_;
  bool news_ = false;  // there is news in this pass
  std::atomic<bool> inputs_changed_{false};
  EngineState state_;
  LatenessRecord lateness_;
  Snapshot<EngineState> figures_;
};

}  // namespace stepdriver::pulse
