#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bus/register_job.h"
#include "bus/register_port.h"
#include "machine/controller.h"
#include "machine/shell_core.h"
#include "machine/wiring.h"
#include "pulse/pulse_engine.h"
#include "search/failing_reads.h"
#include "search/hull.h"
#include "search/oracle.h"
#include "search/rise_watch.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/sim/rig.h"
#include "support/ahead_port.h"
#include "trajectory/prepared_trajectory.h"

namespace stepdriver::search {

/// Participants that can take the next step.
enum class Who {
  kNews,     ///< the controller takes what the engine has reported
  kPinDone,  ///< the controller takes a pin that was written, or failed
  kInput,    ///< the controller takes a level or an edge
  kRequest,  ///< the controller takes a request, and the levels that its caller has read
  kTimer,    ///< the controller is told that time has passed
  kEngine,   ///< a pass of the engine
  kWriter,   ///< the writer of the slow lines
  kWatcher,  ///< the watcher of the inputs
  kClientA,
  kClientB,
  kClock,
  kBoard,    ///< what plays the steps that were put ahead of time; not with a GpioPort
  kBus,      ///< an access to a register of a chip; only with such a chip
  kBusDone,  ///< the controller takes the end of a job on registers; the same
};
constexpr std::size_t kParticipants = 14;
const char* nameOf(Who who);

/// From the n-th step after the script's first request, a participant has to wait for some steps.
struct Deviation {
  std::size_t from = 0;
  Who who = Who::kNews;
  std::size_t steps = 0;
};

struct Act;

/// A line of a script: an action of a client, or an event of the machine.
struct Item {
  std::size_t act = 0;               ///< index in acts()
  int client = 0;                    ///< 0 or 1
  std::size_t after = 0;             ///< steps after the item before it
  std::shared_ptr<const Act> own{};  ///< done instead of the one in acts(), if there is any
};

/// Machines that a schedule can be played on.
constexpr std::size_t kVariants = 7;
/// In this one x is homed against a block that an input reports, y has a motor of phases, and the
/// switches of z's ends and y's min switch share a line.
constexpr int kPhases = 5;
/// In this one the driver of x has registers on a UART, and is homed by its stall.
constexpr int kRegisters = 6;
/// The axes of one of them, as it is configured by default.
std::vector<config::AxisConfig> configsOf(int variant);

/// A port that takes steps ahead of time.
struct Ahead {
  pulse::Nanoseconds horizon = 0;
  pulse::Nanoseconds late = 0;  ///< by how much it plays them later than planned; below 0: earlier
  pulse::Nanoseconds take_back = 0;  ///< how long it plays on when they are taken back
};

/// Everything that determines the course of a run.
struct Schedule {
  int variant = 0;
  std::vector<Item> items;
  std::vector<Deviation> deviations;
  bool may_last = false;  ///< its motions may take longer than a run; a stop ends them
  /// Other axes than configsOf(), with the same lines; empty: those.
  std::vector<config::AxisConfig> machine{};
  /// The steps go out by a port of this kind; empty: by a GpioPort.
  std::optional<Ahead> ahead{};
};

class Participants;

/// An action of a client, or an event.
struct Act {
  std::string name;
  std::function<void(Participants&, int client)> begin;
};

/// One of several acts of a client.
struct Turn {
  pulse::Nanoseconds after = 0;  ///< time since the answer to the one before it
  Act act;
};
const std::vector<Act>& acts();
/// How many of them, from the first on, are for any machine; the rest is for kRegisters.
std::size_t actsOfAny();
const Act& actOf(const Item& item);
/// A path of x and y of two lines at these speeds [m/s], which the client watches.
Act slowPath(double first, double second);
/// @return its index. @throw std::out_of_range
std::size_t actNamed(const std::string& name);

/// A virtual clock that tells whether anybody has woken the thread that serves the engine.
class WatchedClock : public pulse::VirtualClock {
 public:
  void wake() override {
    woken = true;
    VirtualClock::wake();
  }
  bool woken = true;
};

/// The shell's core, an engine and a rig, without threads. In each step one participant acts; the
/// schedule determines which.
class Participants : private machine::ShellCore::Host {
 public:
  explicit Participants(const Schedule& schedule);

  /// Plays the whole schedule, ends what is still active, and checks that all axes can move again.
  /// @return the failure; empty if there is none.
  std::vector<std::string> run();

  std::size_t steps() const { return steps_; }
  /// @param hash is given all edges; it outlives this.
  void hashTo(EdgeHash& hash) { trace_->hash = &hash; }
  /// From now on, writes down each step.
  const std::vector<activity::AcceptedHoming>& homings() const { return homings_; }
  /// What the position of y has made the tool do.
  std::uint64_t compared() const { return engine_->output(0).compared; }
  void keepLog() { log_ = true; }
  const std::vector<std::string>& log() const { return lines_of_log_; }

  /// @name Actions of the acts
  /// @{
  void post(int client, const std::string& name, machine::Request request, const Meaning& meaning);
  /// Begins each act when the one before it has been answered.
  void postInTurn(int client, std::deque<Turn> turns);
  /// Jogs as a joystick does, without waiting for a result.
  void streamJog(int client, std::size_t axis);
  /// Streams positions, forward and back, at the period of streamJog().
  void streamSetpoints(int client, const std::vector<std::size_t>& axes);
  void postTrajectory(int client, std::vector<std::size_t> axes, double size);
  /// One that begins a little later, whatever the axes do until then.
  void postLaterTrajectory(int client, std::vector<std::size_t> axes, double size);
  /// A path of several axes at rest that can be fed until appendToPath() ends it.
  void postPath(int client, const std::vector<std::size_t>& axes, double size);
  /// One that switches the tool on at its second line, and off in the middle of its third.
  void postMarkedPath(int client, const std::vector<std::size_t>& axes, double size);
  /// Two short lines at these speeds [m/s], each of which takes at most half a minute.
  void postSlowPath(int client, const std::vector<std::size_t>& axes, double first, double second);
  /// Appends to the path that an axis follows, if it is one; a last segment ends it.
  /// @param size of the segment; 0: none, only that this is the end.
  void appendToPath(int client, std::size_t axis, double size, bool is_last);
  void switchTool(int client, bool on);
  /// Probes along a line of axes, goes back from the contact, and touches it again slowly. The
  /// carriage of x presses the probe. @param ways [m] of each axis
  void postProbing(int client, const std::vector<std::size_t>& axes,
                   const std::vector<double>& ways, bool away);
  /// Latches where all axes are at each edge of the probe, until endLatches().
  void beginLatch(int client);
  void endLatches(int client);
  /// The position of y switches the tool: by a cam around where it begins, or for the other client
  /// by pulses.
  void compareTool(int client);
  void emergencyStop(int client);
  void shutDown(int client);
  void stopLastMove(int client, std::size_t axis);
  void cancelHomings(int client);
  void pressSwitch(std::size_t axis, bool pressed);
  void pressEmergencyStop(bool pressed);
  void breakChip(std::size_t axis);
  /// From now on z's driver isn't in position, whatever it does.
  void neverInPosition();
  /// The relay of the motor power opens, whatever its line says; lines that work again close it.
  void loseMotorPower();
  void failSteps(std::size_t axis);
  void failTurns(std::size_t axis);
  void failSwitch(std::size_t axis);
  void failEmergencyStop();
  void mendLines();
  /// @name Troubles of the chip of x, if it has registers; lines that work again end them.
  /// @{
  void resetChip();
  void silenceChip();
  void heatChip();
  /// @}
  void failNextPin(int error) { next_pin_error_ = error; }
  void hangNextPin(pulse::Nanoseconds time) { next_pin_hang_ = time; }
  void loseEdges() { loses_edges_ = edges_were_lost_ = true; }
  /// @}

 private:
  struct Ask {
    std::uint64_t id = 0;
    int client = 0;
    std::string name;
    machine::Request request;
    Meaning meaning;
    std::vector<std::size_t> goals;      ///< axes for which it has a goal
    std::vector<std::size_t> parts;      ///< axes that it may move, or refuse, one by one
    bool together = false;               ///< along one path
    bool begins_later = false;           ///< not when it is answered
    std::optional<std::size_t> enables;  ///< this axis
    bool relative = false;
    std::vector<double> ways;  ///< how far a relative goal is, for each goal
    std::vector<std::optional<double>> targets;
    std::array<std::size_t, kAxes> orders{};  ///< the orders of each axis when the call was served
    pulse::Nanoseconds posted = 0;
    std::size_t posted_step = 0;
  };
  struct Job {
    activity::PinJob job;
    pulse::Nanoseconds deadline = 0;
    pulse::Nanoseconds returns = 0;
    int error = 0;
    bool told = false;
  };
  /// A job on registers, one access after the other.
  struct Access {
    bus::RegisterJob job;
    bus::RegisterDone done;
    std::size_t next = 0;
    pulse::Nanoseconds due = pulse::kNever;
    bool ended = false;
  };
  struct Client {
    std::uint64_t waits_for = 0;  // a call; 0: doesn't wait
    std::optional<std::uint64_t> waits_for_stops;
    std::function<void()> next;   // its next step
    pulse::Nanoseconds from = 0;  // clock time before which it doesn't take its next step
    std::deque<Turn> turns;       // begin one after the other
    std::function<void(const activity::Reply&)> on_answer;
    bool waits() const { return waits_for != 0 || waits_for_stops; }
    bool idle() const { return !waits() && !next && turns.empty(); }
  };
  /// A motion that the engine was ordered to make.
  struct Ordered {
    std::uint64_t serial = 0;
    bool together = false;
  };
  class News : public pulse::NewsListener {
   public:
    explicit News(machine::ShellCore& core) : core_(core) {}
    void onNews() noexcept override { core_.noteNews(); }

   private:
    machine::ShellCore& core_;
  };

  bool step();
  bool canGo(Who who);
  void go(Who who);
  void act(Who who);
  void answerEmergencyStops();
  void checkOutputs();
  bool isDelayed(Who who) const;
  void turnEnded(const machine::MachineSnapshot& before,
                 const std::shared_ptr<const machine::MachineSnapshot>& now,
                 activity::Outputs& out) override;
  void write(const activity::PinJob& job) override;
  void access(const bus::RegisterJob& job) override;
  void answer(std::uint64_t call, activity::Reply reply);
  void note(const std::string& what);
  void watch();
  void writeLines();
  void accessRegister();
  void noteTrouble();
  void checkTroubles();
  void checkRegisters();
  bool isStuck();
  void beginItem();
  bool itemReady() const;
  bool hasTurn(const Client& client) const;
  void beginTurn(int client);
  void pauseBeforeTurn(Client& client);
  bool engineIsDue();
  bool boardIsDue();
  pulse::Nanoseconds latestTime();
  pulse::Nanoseconds nextDue();
  void advanceTo(pulse::Nanoseconds time);
  std::vector<int> readInputs();
  void moveEnds(const machine::MachineSnapshot& before, const std::vector<std::size_t>& axes,
                const std::vector<double>& targets);
  /// What a trajectory is prepared from.
  struct Wish {
    std::vector<std::size_t> axes;
    double size = 0.0;
    std::vector<std::uint64_t> stops;
    pulse::Nanoseconds begin_in = 0;
  };
  void wish(int client, std::vector<std::size_t> axes, double size, pulse::Nanoseconds begin_in);
  void prepareAndPost(int client, const Wish& wish, int tries);
  void followPath(int client, const std::vector<std::size_t>& axes, double size,
                  motion::PathRequest request);
  void checkMarks();
  /// A probing under way: its touches, and the way back between them.
  struct ProbingUnderWay {
    machine::ProbeStroke stroke;
    machine::LatchEdge edge = machine::LatchEdge::kActive;
    Meaning meaning;
    std::vector<double> begin;  // [m]
    std::vector<double> targets;
    std::vector<double> contact;
    int strokes = 0;
    std::shared_ptr<const axis::Outcome<axis::MoveResult>> outcome;
  };
  void postStroke(int client, ProbingUnderWay probing);
  void awaitStroke(int client, const ProbingUnderWay& probing);
  void strokeEnded(int client, ProbingUnderWay probing, const axis::MoveResult& ended);
  machine::BeginLatch latchOf(const std::vector<std::size_t>& axes, machine::LatchEdge edge);
  void forgetLatch(std::uint64_t id);
  void checkEdge(const machine::LatchedEdge& edge);
  void checkLatches();
  void postStreamedJog(int client, std::size_t axis, const machine::Jog& jog, std::uint64_t as_of,
                       int left);
  void postStreamedSetpoints(int client, const machine::FollowSetpoints& setpoints,
                             std::uint64_t as_of, int number);
  void noteRefusals(std::uint64_t call, const Ask& asked, const activity::Refusals& refusals);
  void noteGoals(Ask& asked);
  void noteServed(Ask& asked);
  std::optional<double> relativeOrigin(std::size_t axis);
  void checkMoves(const Ask& asked, const std::vector<axis::Move>& moves);
  void checkSlowing(const Ask& asked);
  void checkEnabled(const Ask& asked);
  void serveEngine();
  activity::Reply ask(const std::string& name, machine::Request request, const Meaning& meaning);
  /// Plays on until the condition is true. @return false if that takes too long.
  bool playUntil(const std::function<bool()>& ready, pulse::Nanoseconds longest);
  bool atRest();
  /// @name Where the pulses may lead, on the rig [configured microsteps]
  /// @{
  double placeOnRig(std::size_t axis) const;
  double untoldOf(std::size_t axis) const;
  double roundingOf(std::size_t axis) const;
  double onRig(std::size_t axis, double position);
  bool mayRest(std::size_t axis, std::uint64_t call);
  bool mayRestAlone(std::size_t axis, std::uint64_t call);
  double stoppingWay(std::size_t axis) const;
  void noteLimits(const machine::SetLimits& set);
  void passes(std::size_t motor);
  bool leavesBehind(const Ask& asked, std::size_t axis);
  void beginHulls(const Ask& asked);
  void widenHull(const Ask& asked, std::size_t axis);
  void checkHull(std::size_t axis);
  /// @}
  void checkLive();
  void checkLive(std::size_t axis);
  void checkCounts(const std::string& when);
  void checkCount(std::size_t axis, const std::string& when);
  void checkPowered(std::size_t axis, pulse::Nanoseconds now);
  sim::RigAxisReport reportOf(const std::string& rig_axis) const;
  void checkRest();
  void checkCompared();
  void checkPulse();
  void checkPower();
  bool ramps() const;
  std::optional<pulse::Nanoseconds> rampBegins() const;
  void checkEnds();
  void checkOutcomes();
  void checkInPosition();
  void probe();
  void probeAxis(std::size_t axis);
  bool leaveSharedSwitch(std::size_t axis);
  void judgeDone();

  const Schedule schedule_;
  std::vector<config::AxisConfig> configs_;
  Oracle oracle_;
  WatchedClock clock_;
  std::shared_ptr<RiseWatch> trace_;
  sim::Rig rig_;
  gpio::SimulatedBackend backend_;
  machine::Wiring wiring_;
  std::shared_ptr<FailingReads> lines_;
  std::unique_ptr<test::AheadPort> port_;  // null: the engine has its own
  std::unique_ptr<pulse::PulseEngine> engine_;
  std::unique_ptr<machine::Controller> controller_;
  std::unique_ptr<machine::ShellCore> core_;
  std::unique_ptr<News> news_;

  // Participants that the core has in the shell.
  std::deque<Ask> requests_;
  std::deque<activity::PinDone> pins_done_;
  std::deque<Job> jobs_;
  std::unique_ptr<bus::RegisterPort> registers_;
  std::deque<Access> accesses_;
  std::deque<bus::RegisterDone> accesses_done_;
  std::optional<pulse::Nanoseconds> trouble_since_;  // of x's chip; empty: it is known
  bool had_trouble_ = false;
  bool is_silent_ = false;
  pulse::Nanoseconds engine_due_ = 0;
  pulse::Nanoseconds engine_waits_since_ = pulse::kNever;
  std::vector<int> watched_;
  pulse::Nanoseconds watch_due_ = pulse::kNever;
  pulse::Nanoseconds watcher_waits_since_ = pulse::kNever;
  bool loses_edges_ = false;
  bool edges_were_lost_ = false;
  bool compares_pulses_ = false;
  bool tool_was_on_ = false;
  bool tool_level_ = true;  // while it is on
  int next_pin_error_ = 0;
  bool pins_failed_ = false;  // or took long
  pulse::Nanoseconds next_pin_hang_ = 0;

  // The clients: the two of the script, and one that begins and ends the run.
  static constexpr int kProbe = 2;
  std::array<Client, 3> clients_;
  std::map<std::uint64_t, Ask> open_;
  std::map<std::uint64_t, std::string> answered_;
  std::uint64_t calls_ = 0;
  std::size_t next_item_ = 0;
  std::size_t item_step_ = 0;
  bool closed_ = false;
  bool close_was_served_ = false;
  std::vector<std::pair<std::string, axis::Move>> moves_;
  std::set<std::uint64_t> open_paths_;  // moves along paths of which more is to come
  // The outcomes of paths that switch an output, and how often each does.
  std::vector<std::pair<std::shared_ptr<const axis::Outcome<axis::MoveResult>>, std::size_t>>
      marked_;
  std::optional<std::size_t> never_in_position_;  // how many moves there were by then
  std::array<std::uint64_t, kAxes> last_move_{};
  std::array<std::vector<Ordered>, kAxes> ordered_;
  std::array<bool, kAxes> had_setpoints_{};
  std::array<std::array<bool, kAxes>, kAxes> together_{};  // have ever been in one motion
  std::array<bool, kAxes> steps_failed_{};
  std::array<bool, kAxes> chip_broke_{};
  std::optional<pulse::Nanoseconds> power_lost_since_;
  bool power_was_lost_ = false;
  std::uint64_t input_stops_ = 0;
  bool engine_reads_inputs_ = false;
  std::vector<activity::AcceptedHoming> homings_;
  std::vector<std::pair<std::uint64_t, std::shared_ptr<machine::LatchRecord>>> latches_;
  bool position_changed_ = false;
  std::array<Hull, kAxes> hulls_;
  std::array<axis::AxisLimits, kAxes> lowest_limits_{};
  std::array<bool, kAxes> waits_{};  // something that begins later was asked of it
  std::array<std::vector<double>, kAxes> path_begins_;     // on the rig
  std::array<std::vector<std::size_t>, kAxes> path_axes_;  // the axes of the last path of each axis

  std::size_t steps_ = 0;
  std::size_t script_began_ = 0;
  bool script_ = false;
  bool log_ = false;
  std::vector<std::string> lines_of_log_;
};

}  // namespace stepdriver::search
