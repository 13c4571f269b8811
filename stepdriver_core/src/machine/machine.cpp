#include "stepdriver_core/machine/machine.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "bus/open_port.h"
#include "controller.h"
#include "flight_recorder.h"
#include "give_way.h"
#include "machine/disposer.h"
#include "machine_axis.h"
#include "message_text.h"
#include "nanoseconds.h"
#include "port/port_backend.h"
#include "printable.h"
#include "probing.h"
#include "pulse/measure.h"
#include "pulse/pulse_engine.h"
#include "read_options.h"
#include "shell.h"
#include "state_keeper.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/step_rates.h"
#include "trajectory/backlash.h"
#include "trajectory/path_plan.h"
#include "wiring.h"

namespace stepdriver::machine {
namespace {

constexpr double kLeastOverride = 0.01;
constexpr double kMostOverride = 2.0;
constexpr int kMostPreparations = 8;
// An append changes the motion at least this far ahead. That is tried this often before the motion
// is changed only at its end.
constexpr pulse::Nanoseconds kLeastLead = 20'000'000;
constexpr int kMostExtensions = 5;
// [s] How much of a path that was passed is kept: an order that the engine refuses takes it back.
constexpr double kKept = 0.5;
// [s] The bounds of the timeout of setpoints.
constexpr double kShortestTimeout = 0.005;
constexpr double kLongestTimeout = 60.0;

}  // namespace

class Machine::Impl {
 public:
  Impl(const std::vector<config::AxisConfig>& configs, gpio::Backend& backend, pulse::Clock& clock,
       const MachineOptions& options, bool threaded)
      : clock_(clock), disposer_(threaded), outputs_(options.outputs), inputs_(options.inputs) {
    checkConfiguration(configs, options);
    if (!options.state_file.empty()) keeper_ = std::make_unique<StateKeeper>(options.state_file);
    const Wiring wiring(configs, options);
    lines_ = backend.request(wiring.outputs, wiring.inputs);
    if ((ports_ = dynamic_cast<pulse::PortBackend*>(&backend)) != nullptr) {
      port_ = ports_->makePort(*lines_, clock,
                               pulse::PulseEngine::lanesOf(wiring.channels, wiring.shared));
    }
    // What a port of its own plays doesn't depend on the times of this computer.
    if (options.measure && clock.realtime() && !port_) {
      capability_ = pulse::measureCapability(*lines_, clock, wiring.channels, options.realtime);
      capability_->late_steps = options.late_steps;
      const std::string why = options.enforce ? whyNotInRealtime(configs, *capability_) : "";
      if (!why.empty()) throw Refused(why);
    }
    for (std::size_t i = 0; i < wiring.outputs.size(); ++i) {
      names_.outputs.push_back(lines_->outputName(static_cast<int>(i)));
    }
    for (std::size_t i = 0; i < wiring.inputs.size(); ++i) {
      names_.inputs.push_back(lines_->inputName(static_cast<int>(i)));
    }
    names_.failure = [&lines = *lines_](bool input, int line) {
      return lines.failureText(input, line);
    };
    engine_ = makeEngine(wiring, options);
    engine_->switchOutputs(wiring.switchedOutputs(options));
    controller_ = std::make_unique<Controller>(
        configs, wiring.motor_lines, names_, wiring.emergency_stop, options.emergency_disable,
        wiring.motorPower(options), wiring.namedLines(options), engine_->horizon());
    if (options.emergency_disable == EmergencyDisable::kRamp) {
      engine_->rampStops(longestRamp(configs));
    }
    if (wiring.heartbeat) engine_->beat(*wiring.heartbeat);
    if (options.record_seconds > 0.0) {
      recorder_ = std::make_unique<FlightRecorder>(
          configs, wiring, names_, clock.now(),
          FlightRecorder::Options{options.record_seconds, options.record_bytes, options.outputs});
      engine_->recordTo(recorder_->pulseRing());
    }
    Shell::Options shell_options;
    shell_options.threaded = threaded;
    shell_options.write_timeout_ns = nanoseconds(options.write_timeout);
    shell_options.realtime = options.realtime;
    shell_options.on_motion = [this] {
      if (keeper_) keeper_->noteMotion();
    };
    shell_options.on_io = [this](const IoStates& states) {
      const std::lock_guard<std::mutex> lock(io_mutex_);
      if (on_io_) on_io_(states);
    };
    shell_options.recorder = recorder_.get();
    shell_options.open_port = [&backend](const std::string& port, int baud) {
      return bus::openPort(port, baud, backend.simulatedSerial(port));
    };
    shell_ = std::make_unique<Shell>(*controller_, *engine_, clock, lines_, wiring, shell_options);
    for (std::size_t i = 0; i < configs.size(); ++i) {
      axes_.push_back(std::make_unique<axis::Axis>(std::make_unique<axis::Axis::Impl>(
          axis::Axis::Impl{configs[i], i, wiring.motor_lines[i], *shell_, *lines_, names_})));
    }
    try {
      StateKeeper::Loaded loaded;
      if (keeper_) loaded = keeper_->load();
      ask(*shell_, BringUp{loaded.state.axes});
      if (keeper_) startKeeping(loaded, threaded);
    } catch (const Error&) {
      // Brakes take time: the lines are released only when they are engaged.
      powerDownQuietly();
      throw;
    }
  }

  ~Impl() {
    try {
      shutdown();
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): the caller of shutdown() learns it
    }
    shell_->stop();
  }

  std::unique_ptr<pulse::PulseEngine> makeEngine(const Wiring& wiring,
                                                 const MachineOptions& options) {
    const pulse::Nanoseconds max_lateness = nanoseconds(options.max_lateness);
    if (port_) {
      return std::make_unique<pulse::PulseEngine>(*port_, *lines_, clock_, wiring.channels,
                                                  max_lateness, wiring.emergency_stop,
                                                  wiring.shared);
    }
    return std::make_unique<pulse::PulseEngine>(*lines_, clock_, wiring.channels, max_lateness,
                                                wiring.emergency_stop, wiring.shared);
  }

  AxisId idOf(const std::string& name) const {
    for (AxisId id = 0; id < axes_.size(); ++id) {
      if (axes_[id]->config().name == name) return id;
    }
    throw Refused(fmt::format("there is no axis {} (axes: {})", name, allNames()));
  }

  BeginLatch latchOf(const LatchRequest& request) {
    BeginLatch begin;
    begin.wanted = request;
    const auto input =
        std::find_if(inputs_.begin(), inputs_.end(),
                     [&](const config::InputConfig& any) { return any.name == request.input; });
    if (input == inputs_.end()) {
      throw Refused(fmt::format("there is no input {} (inputs: {})", printable(request.input),
                                joinedText(inputs_, [](const auto& any) { return any.name; })));
    }
    begin.input = static_cast<std::size_t>(input - inputs_.begin());
    if (!request.axes.empty()) begin.axes = idsOf(request.axes);
    for (AxisId id = 0; request.axes.empty() && id < axes_.size(); ++id) begin.axes.push_back(id);
    if (const auto& window = request.window) {
      begin.window_axis = idOf(window->axis);
      if (!(window->from <= window->to)) {
        throw Refused(
            fmt::format("the window of the latch is from {} to {}, but must be from a "
                        "lower position to a higher one",
                        numberText(window->from), numberText(window->to)));
      }
    }
    begin.id = ++latches_;
    begin.record = std::make_shared<LatchRecord>();
    return begin;
  }

  // A hold between two strokes only delays the second.
  void awaitResume(const std::function<bool()>& cancelled) {
    const auto is_held = [this] { return shell_->snapshot()->axes.front().state.held; };
    if (!is_held()) return;
    shell_->wait([&] { return !is_held() || (cancelled && cancelled()); },
                 static_cast<bool>(cancelled));
  }

  /// @return when it has ended. @throw Refused
  ProbeStrokeResult probeStroke(Machine& machine, ProbeStroke stroke,
                                const std::function<bool()>& cancelled) {
    std::vector<std::string> names;
    for (const AxisId id : stroke.line.axes) names.push_back(axes_[id]->config().name);
    const auto record = stroke.latch ? stroke.latch->record : nullptr;
    ProbeStrokeResult ended;
    const auto begin = stroke.begin;
    if (!stroke.is_first) awaitResume(cancelled);
    const CoordinatedMove line = moveOf(names, ask(*shell_, std::move(stroke)));
    ended.begin = *begin;
    for (const CoordinatedMove::Member& member : line.members) {
      ended.targets.push_back(member.move.target);
    }
    const auto is_over = [&] { return result(line) && (!record || record->result()); };
    shell_->wait(
        [&] {
          if (is_over()) return true;
          ended.was_cancelled = cancelled && cancelled();
          return ended.was_cancelled;
        },
        static_cast<bool>(cancelled));
    if (ended.was_cancelled) {
      machine.stop(line);
      shell_->wait(is_over);
    }
    ended.line = *result(line);
    if (record) ended.latched = *record->result();
    return ended;
  }

  ProbeResult probe(Machine& machine, const ProbeRequest& request,
                    const std::function<bool()>& cancelled) {
    ProbeStroke first;
    first.line = lineOf(request.names, request.positions);
    first.line.relative = request.relative;
    const auto now = shell_->snapshot();
    for (const AxisId id : first.line.axes) {
      first.stops.push_back(now->axes.at(id).stopsOtherThanHolds());
    }
    LatchRequest latch;
    latch.input = request.input;
    latch.edge = request.away ? LatchEdge::kInactive : LatchEdge::kActive;
    latch.axes = request.names;
    bool is_first = true;
    const auto stroke_to = [&](const std::vector<double>& positions) {
      ProbeStroke stroke = first;
      stroke.is_first = std::exchange(is_first, false);
      if (!stroke.is_first) stroke.line.continueTo(positions);
      return stroke;
    };
    Probing::Means means;
    means.touch = [&](const std::vector<double>& positions, double velocity) {
      ProbeStroke stroke = stroke_to(positions);
      stroke.line.velocity = velocity;
      stroke.latch = latchOf(latch);
      return probeStroke(machine, std::move(stroke), cancelled);
    };
    means.go_back = [&](const std::vector<double>& positions) {
      return probeStroke(machine, stroke_to(positions), cancelled);
    };
    return Probing(request, std::move(means)).run();
  }

  std::string allNames() const {
    return joinedText(axes_, [](const auto& axis) { return axis->config().name; });
  }

  MoveLine lineOf(const std::vector<std::string>& names,
                  const std::vector<double>& positions) const {
    MoveLine line;
    line.axes = idsOf(names);
    line.positions = positions;
    if (positions.size() == line.axes.size()) return line;
    throw Refused(
        fmt::format("there are {} names, but {} positions", line.axes.size(), positions.size()));
  }

  CoordinatedMove moveLine(const motion::LineRequest& request) {
    MoveLine line = lineOf(request.names, request.positions);
    line.relative = request.relative;
    line.velocity = request.velocity;
    line.duration = request.duration;
    return moveOf(request.names, ask(*shell_, std::move(line)));
  }

  static std::vector<std::string> refusalsOf(const activity::Reply& reply) {
    return std::get<activity::Refusals>(reply.value);
  }

  std::vector<AxisId> idsOf(const std::vector<StreamMessage>& messages) const {
    std::vector<std::string> names;
    names.reserve(messages.size());
    for (const StreamMessage& message : messages) names.push_back(message.name);
    return idsOf((names));
  }

  std::vector<std::string> jog(const std::vector<StreamMessage>& messages) {
    const std::vector<AxisId> axes = idsOf(messages);
    JogTogether wanted;
    for (std::size_t i = 0; i < axes.size(); ++i) {
      wanted.jogs.push_back({axes[i], messages[i].value, messages[i].unless_stopped_since});
    }
    return refusalsOf(ask(*shell_, std::move(wanted)));
  }

  std::vector<std::string> followSetpoints(SetpointMode mode, double timeout,
                                           const std::vector<StreamMessage>& messages) {
    if (!(timeout >= kShortestTimeout && timeout <= kLongestTimeout)) {
      throw Refused(
          fmt::format("the timeout of setpoints is {:.9g} s, but must be from {:g} to {:g} s",
                      timeout, kShortestTimeout, kLongestTimeout));
    }
    const std::vector<AxisId> axes = idsOf(messages);
    FollowSetpoints wanted{mode, timeout, {}};
    for (std::size_t i = 0; i < axes.size(); ++i) {
      wanted.setpoints.push_back({axes[i], messages[i].value, messages[i].unless_stopped_since});
    }
    return refusalsOf(ask(*shell_, std::move(wanted)));
  }

  CoordinatedMove followTrajectory(const motion::TrajectoryRequest& request) {
    if (!(request.begin_in >= 0.0 && request.begin_in < motion::Profile::kLongest)) {
      throw Refused(fmt::format("the trajectory begins in {} s, but must begin in 0 to {} s",
                                numberText(request.begin_in),
                                numberText(motion::Profile::kLongest)));
    }
    const std::int64_t begins_ns =
        request.begin_in > 0.0 ? shell_->motionNow() + nanoseconds(request.begin_in) : 0;
    return follow(request.names, [&](const MachineSnapshot& now, FollowTrajectory& wanted) {
      wanted.begins_ns = begins_ns;
      std::vector<motion::PathAxis> facts = factsOf(now, wanted.axes);
      const std::vector<motion::MotionState> expected = begins_ns > 0
                                                            ? statesAt(begins_ns, now, wanted.axes)
                                                            : expectedStates(wanted.axes, facts);
      const std::vector<motion::TrajectoryPoint> points = turned(request.points, facts, expected);
      wanted.prepared = disposer_.keep(std::make_shared<const motion::PreparedTrajectory>(
          std::move(facts), points, expected, request.allow_slower));
    });
  }

  // Points whose first position on each continuous axis is the one that is nearest to the axis.
  static std::vector<motion::TrajectoryPoint> turned(
      std::vector<motion::TrajectoryPoint> points, const std::vector<motion::PathAxis>& facts,
      const std::vector<motion::MotionState>& expected) {
    for (std::size_t i = 0; i < facts.size(); ++i) {
      if (points.empty() || i >= points.front().positions.size()) continue;  // it will be refused
      const double begin = facts[i].positionOf(expected[i].position.value());
      const double turns = facts[i].turnsTowards(begin, points.front().positions[i]);
      if (!(std::abs(turns) > 0.0)) continue;
      for (motion::TrajectoryPoint& point : points) {
        if (i < point.positions.size()) point.positions[i] += turns;
      }
    }
    return points;
  }

  CoordinatedMove followPath(const motion::PathRequest& request) {
    return follow(request.names, [&](const MachineSnapshot& now, FollowTrajectory& wanted) {
      const std::vector<motion::PathAxis> facts = factsOf(now, wanted.axes);
      const std::vector<motion::PathOrigin> origins = originsOf(now, wanted.axes);
      motion::PathPlan plan = motion::planPath(request, facts, origins, outputs_);
      wanted.path.emplace();
      std::vector<motion::MotionState> expected;
      for (const motion::PathOrigin& origin : origins) {
        wanted.path->from.push_back(origin.rest);
        expected.push_back({motion::DoubleDouble(origin.rest)});
      }
      wanted.path->targets = std::move(plan.targets);
      if (plan.window) wanted.path->window = disposer_.keep(std::move(plan.window));
      wanted.prepared = disposer_.keep(std::make_shared<const motion::PreparedTrajectory>(
          facts, plan.points, expected, false, std::move(plan.marks)));
    });
  }

  double pathDuration(const motion::PathRequest& request, const std::vector<double>& from) const {
    if (request.more_follows) throw Refused("a path is planned as a whole: no more may follow");
    const std::vector<AxisId> axes = idsOf((request.names));
    const auto now = shell_->snapshot();
    const std::vector<motion::PathAxis> facts = factsOf(*now, axes);
    const std::vector<motion::PathOrigin> origins =
        from.empty() ? originsOf(*now, axes) : originsAt(from, facts);
    const motion::PathPlan plan = motion::planPath(request, facts, origins, outputs_);
    std::vector<motion::MotionState> begin;
    begin.reserve(origins.size());
    for (const motion::PathOrigin& origin : origins) {
      begin.push_back({motion::DoubleDouble(origin.rest)});
    }
    const motion::PreparedTrajectory checked(facts, plan.points, begin);
    return plan.points.back().time;
  }

  // Replaces the path by a longer one, from some time ahead on; later if that was too soon.
  motion::PathAhead appendPath(const motion::PathAppend& request) {
    const pulse::Nanoseconds least_lead = engine_->horizon() + kLeastLead;
    pulse::Nanoseconds lead = least_lead;
    for (int i = 0;; ++i) {
      const pulse::Nanoseconds began = clock_.now();
      const auto snapshot = shell_->snapshot();
      const auto id = followerOf(*snapshot, request.path);
      if (!id) {
        throw Refused(fmt::format("the path {} doesn't continue: {}", request.path,
                                  howItEnded(*snapshot, request.path)));
      }
      const AxisSnapshot::Path& path = *snapshot->axes[*id].path;
      const auto queued = std::dynamic_pointer_cast<const motion::QueuedPath>(path.shared);
      if (!queued) throw Refused("the path is complete: it was told that no more follows");
      const double passed = path.along->stateAt(shell_->motionNow()).position.value();
      if (request.segments.empty() && request.more_follows) return queued->aheadOf(passed);
      double changeable = path.along->endPosition().value();
      if (!path.slows_down && i < kMostExtensions) {
        changeable = path.along->stateAt(shell_->motionNow() + lead).position.value();
      }
      std::shared_ptr<const motion::QueuedPath> continued;
      activity::Extension extension;
      try {
        const Interruptible extending([&] { return isLost(*shell_->snapshot(), request.path); });
        motion::QueuedPath::Longer longer = queued->extended(
            request.segments, request.more_follows, std::max(0.0, passed - kKept), changeable);
        continued = disposer_.keep(std::move(longer.path));
        extension = {queued,          continued,           longer.same_from, longer.same_until,
                     longer.moves_on, continued->targets()};
      } catch (const Interrupted&) {  // NOLINT(bugprone-empty-catch): the controller knows why
      }
      const activity::Reply reply = shell_->call(ExtendPath{*id, path.move, extension});
      const bool outdated =
          reply.failure && reply.failure->kind == activity::Failure::Kind::kOutdated;
      if (outdated && i < kMostExtensions + kMostPreparations) {
        lead = least_lead + 2 * (clock_.now() - began);
        continue;
      }
      valueOf(reply);
      return continued->aheadOf(passed);
    }
  }

  std::optional<motion::PathAhead> pathAhead(std::uint64_t number) const {
    const auto snapshot = shell_->snapshot();
    const auto id = followerOf(*snapshot, number);
    if (!id) return std::nullopt;
    const AxisSnapshot::Path& path = *snapshot->axes[*id].path;
    const auto queued = std::dynamic_pointer_cast<const motion::QueuedPath>(path.shared);
    if (!queued) return std::nullopt;
    return queued->aheadOf(path.along->stateAt(shell_->motionNow()).position.value());
  }

  // Whether a path can't be continued any more: it has ended, or it comes to rest for good.
  static bool isLost(const MachineSnapshot& now, std::uint64_t path) {
    const auto id = followerOf(now, path);
    if (!id) return true;
    const auto& motions = now.axes[*id].motions;
    return !motions.empty() && motions.back().slows_down;
  }

  // The axis by whose move a path is numbered.
  static std::optional<AxisId> followerOf(const MachineSnapshot& snapshot, std::uint64_t path) {
    for (AxisId id = 0; id < snapshot.axes.size(); ++id) {
      const auto& followed = snapshot.axes[id].path;
      if (followed && followed->move == path) return id;
    }
    return std::nullopt;
  }

  static std::string howItEnded(const MachineSnapshot& snapshot, std::uint64_t path) {
    const auto followed =
        std::find_if(snapshot.axes.begin(), snapshot.axes.end(), [path](const AxisSnapshot& axis) {
          return axis.ended_path != nullptr && axis.ended_path->move == path;
        });
    return motion::howItEnded(
        followed != snapshot.axes.end() ? followed->ended_path.get() : nullptr, path);
  }

  // The motion under way, now: about where a trajectory will begin.
  std::vector<motion::MotionState> expectedStates(
      const std::vector<AxisId>& axes, const std::vector<motion::PathAxis>& facts) const {
    std::vector<motion::MotionState> expected;
    expected.reserve(axes.size());
    for (std::size_t i = 0; i < axes.size(); ++i) {
      const axis::AxisState state = shell_->state(axes[i]);
      expected.push_back(
          {facts[i].countOf(state.planned), state.velocity * facts[i].steps_per_unit, 0.0});
    }
    return expected;
  }

  // The states of joints at a time ahead, as far as their present motions tell.
  static std::vector<motion::MotionState> statesAt(std::int64_t at, const MachineSnapshot& now,
                                                   const std::vector<AxisId>& axes) {
    std::vector<motion::MotionState> states;
    states.reserve(axes.size());
    for (const AxisId axis : axes) {
      const AxisSnapshot& own = now.axes.at(axis);
      motion::MotionState& state = states.emplace_back();
      state.position = motion::DoubleDouble(own.rest);
      if (!own.state.moving || own.motions.empty()) continue;
      const motion::Profile& plan = *own.motions.back().planned.plan();
      const double slack =
          motion::slackAt(plan, at, own.backlash).value_or(static_cast<double>(own.channel.slack));
      state = plan.stateAt(at);
      state.position = state.position - slack;
    }
    return states;
  }

  // Prepares a trajectory from the facts about its axes, and again if these have changed meanwhile.
  template <typename Prepare>
  CoordinatedMove follow(const std::vector<std::string>& names, const Prepare& prepare) {
    const std::vector<AxisId> axes = idsOf((names));
    const auto begun = shell_->snapshot();
    FollowTrajectory wanted{axes, nullptr, {}, std::nullopt};
    wanted.stops.reserve(axes.size());
    for (const AxisId axis : axes) wanted.stops.push_back(begun->axes.at(axis).state.stops);
    const std::uint64_t stops_asked = engine_->stopsAsked();
    const auto is_stopped = [&] {
      if (engine_->stopsAsked() != stops_asked) return true;
      const auto now = shell_->snapshot();
      for (std::size_t i = 0; i < axes.size(); ++i) {
        const axis::AxisState& state = now->axes.at(axes[i]).state;
        if (state.stops != wanted.stops[i] || !state.fault.empty()) return true;
      }
      return false;
    };
    for (int i = 0;; ++i) {
      wanted.prepared.reset();
      try {
        const Interruptible preparing(is_stopped);
        prepare(*shell_->snapshot(), wanted);
      } catch (const Interrupted&) {
        wanted.prepared.reset();  // the controller knows why
      }
      const activity::Reply reply = shell_->call(wanted);
      const bool outdated =
          reply.failure && reply.failure->kind == activity::Failure::Kind::kOutdated;
      if (outdated && i < kMostPreparations) continue;
      return moveOf(names, valueOf(reply));
    }
  }

  static std::vector<motion::PathAxis> factsOf(const MachineSnapshot& snapshot,
                                               const std::vector<AxisId>& axes) {
    std::vector<motion::PathAxis> facts;
    facts.reserve(axes.size());
    for (const AxisId axis : axes) facts.push_back(snapshot.axes.at(axis).path_axis);
    return facts;
  }

  static std::vector<motion::PathOrigin> originsAt(const std::vector<double>& positions,
                                                   const std::vector<motion::PathAxis>& facts) {
    if (positions.size() != facts.size()) {
      throw Refused(fmt::format("there are {} names, but {} positions from which the path begins",
                                facts.size(), positions.size()));
    }
    std::vector<motion::PathOrigin> origins;
    for (std::size_t i = 0; i < facts.size(); ++i) {
      if (!std::isfinite(positions[i])) {
        facts[i].refuse(
            fmt::format("the position {} from which the path begins must be a finite "
                        "number",
                        positions[i]));
      }
      facts[i].refuseBeyondLimits(positions[i], "the position from which the path begins");
      origins.push_back({facts[i].restAt(facts[i].countOf(positions[i])), positions[i]});
    }
    return origins;
  }
  static std::vector<motion::PathOrigin> originsOf(const MachineSnapshot& snapshot,
                                                   const std::vector<AxisId>& axes) {
    std::vector<motion::PathOrigin> origins;
    origins.reserve(axes.size());
    for (const AxisId axis : axes) {
      const AxisSnapshot& own = snapshot.axes.at(axis);
      if (own.state.moving) own.path_axis.refuse("it moves; a path begins at rest");
      origins.push_back({own.rest, own.commanded});
    }
    return origins;
  }

  std::vector<AxisId> idsOf(const std::vector<std::string>& names) const {
    if (names.empty()) throw Refused("no axis is named (axes: " + allNames() + ")");
    std::vector<AxisId> ids;
    for (const std::string& name : names) {
      ids.push_back(idOf(name));
      if (std::find(ids.begin(), ids.end() - 1, ids.back()) != ids.end() - 1) {
        throw Refused("the axis " + name + " is named twice");
      }
    }
    return ids;
  }

  std::vector<AxisId> axesToHome(const std::vector<std::string>& names) const {
    if (!names.empty()) return idsOf(names);
    std::vector<AxisId> ids;
    for (AxisId id = 0; id < axes_.size(); ++id) {
      if (axes_[id]->config().homing) ids.push_back(id);
    }
    if (ids.empty()) throw Refused("no axis has homing configured (axes: " + allNames() + ")");
    return ids;
  }

  static CoordinatedMove moveOf(const std::vector<std::string>& names,
                                const activity::Reply& reply) {
    const auto& moves = std::get<std::vector<axis::Move>>(reply.value);
    CoordinatedMove move;
    for (std::size_t i = 0; i < names.size(); ++i) {
      move.members.push_back({names[i], moves[i]});
      move.duration = std::max(move.duration, moves[i].duration);
    }
    return move;
  }

  std::optional<CoordinatedResult> result(const CoordinatedMove& move) const {
    std::vector<axis::MoveResult> results;
    for (const CoordinatedMove::Member& member : move.members) {
      const auto own = axes_[idOf(member.axis)]->result(member.move);
      if (!own) return std::nullopt;
      results.push_back(*own);
    }
    return combinedResult(results);
  }

  void shutdown() {
    if (shut_.exchange(true)) return;
    ask(*shell_, Close{"the machine was shut down"});
    ask(*shell_, AwaitRest{});
    // Disabling a motor may invalidate its position. The state is saved first: the next start
    // decides whether to trust it.
    if (keeper_) keeper_->close(memories());
    ask(*shell_, PowerDown{});
    if (keeper_ && !keeper_->error().empty()) throw StateFileError(keeper_->error());
  }

  StateKeeper::Memories memories() const {
    StateKeeper::Memories memories;
    const auto snapshot = shell_->snapshot();
    for (AxisId id = 0; id < axes_.size(); ++id) {
      memories.emplace(axes_[id]->config().name, snapshot->axes.at(id).memory);
    }
    return memories;
  }

  void powerDownQuietly() {
    try {
      ask(*shell_, Close{"the machine could not begin"});
      ask(*shell_, PowerDown{});
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): the error before this one is thrown
    }
  }

  void startKeeping(const StateKeeper::Loaded& loaded, bool threaded) {
    for (AxisId id = 0; id < axes_.size(); ++id) {
      const auto found = loaded.state.axes.find(axes_[id]->config().name);
      if (found != loaded.state.axes.end()) {
        ask(*shell_, RestorePosition{id, found->second, loaded.state.clean, loaded.source});
      } else {
        ask(*shell_, NotePosition{id, loaded.why_none});
      }
    }
    keeper_->start([this] { return memories(); }, threaded);
  }

  FlightRecorder& recorder() const {
    if (!recorder_) throw Refused(kNothingRecorded);
    return *recorder_;
  }

  pulse::Clock& clock_;
  // Destroyed in this order: axes, shell, controller, engine, recorder, port, lines.
  Disposer disposer_;
  const std::vector<config::OutputConfig> outputs_;
  const std::vector<config::InputConfig> inputs_;
  std::atomic<std::uint64_t> latches_{0};
  std::mutex io_mutex_;  // guards on_io_
  std::function<void(const IoStates&)> on_io_;
  std::shared_ptr<gpio::Lines> lines_;
  axis::LineNames names_;
  std::optional<pulse::Capability> capability_;
  pulse::PortBackend* ports_ = nullptr;
  std::unique_ptr<pulse::StepPort> port_;  // empty: the engine writes the lines
  std::unique_ptr<FlightRecorder> recorder_;
  std::unique_ptr<pulse::PulseEngine> engine_;
  std::unique_ptr<Controller> controller_;
  std::unique_ptr<Shell> shell_;
  std::vector<std::unique_ptr<axis::Axis>> axes_;
  std::unique_ptr<StateKeeper> keeper_;
  std::atomic<bool> shut_{false};
};

CoordinatedResult combinedResult(const std::vector<axis::MoveResult>& members) {
  CoordinatedResult result;
  int worst = -1;
  for (const axis::MoveResult& own : members) {
    result.positions.push_back(own.position);
    result.duration = std::max(result.duration, own.duration);
    result.marks_made = std::max(result.marks_made, own.marks_made);
    result.marks_not_made = std::max(result.marks_not_made, own.marks_not_made);
    result.marks_known = result.marks_known && own.marks_known;
    // An axis's own reason says more than that it was ended together with another one.
    const int weight = own.end == axis::MoveEnd::kReached     ? 0
                       : own.end == axis::MoveEnd::kCompanion ? 1
                                                              : 2;
    if (weight <= worst) continue;
    worst = weight;
    result.end = own.end;
    result.message = own.message;
  }
  if (result.end == axis::MoveEnd::kReached) result.message = "all axes reached their targets";
  return result;
}

Machine::Machine(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend,
                 pulse::Clock& clock, const MachineOptions& options)
    : Machine(axes, backend, clock, options, ServedBy::kThreads) {}

Machine::Machine(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend,
                 pulse::Clock& clock, const MachineOptions& options, ServedBy served_by)
    : impl_(
          std::make_unique<Impl>(axes, backend, clock, options, served_by == ServedBy::kThreads)) {}

Machine::~Machine() = default;

const std::vector<std::unique_ptr<axis::Axis>>& Machine::axes() const { return impl_->axes_; }

axis::Axis& Machine::axis(const std::string& name) const {
  return *impl_->axes_[impl_->idOf(name)];
}

const std::optional<pulse::Capability>& Machine::capability() const { return impl_->capability_; }

void Machine::stop() { ask(*impl_->shell_, StopAll{}); }

void Machine::hold() { ask(*impl_->shell_, Hold{}); }

void Machine::resume() { ask(*impl_->shell_, Resume{}); }

std::vector<axis::HomingResult> Machine::home(const std::vector<std::string>& names,
                                              const std::function<bool()>& cancelled) {
  checkHoming(names);
  return homeInOrder(*impl_->shell_, impl_->axes_, impl_->axesToHome(names), cancelled);
}

void Machine::checkHoming(const std::vector<std::string>& names) const {
  ask(*impl_->shell_, Home{impl_->axesToHome(names), true});
}

void Machine::setSpeedOverride(double factor) {
  if (!(factor >= kLeastOverride && factor <= kMostOverride)) {
    throw Refused(fmt::format("the speed override is {:.9g}, but must be from {:g} to {:g}", factor,
                              kLeastOverride, kMostOverride));
  }
  ask(*impl_->shell_, SetSpeedOverride{factor});
}

std::vector<std::string> Machine::jog(const std::vector<StreamMessage>& messages) {
  return impl_->jog(messages);
}

std::vector<std::string> Machine::followSetpoints(SetpointMode mode, double timeout,
                                                  const std::vector<StreamMessage>& messages) {
  return impl_->followSetpoints(mode, timeout, messages);
}

CoordinatedMove Machine::moveLine(const motion::LineRequest& request) {
  return impl_->moveLine(request);
}

CoordinatedMove Machine::followTrajectory(const motion::TrajectoryRequest& request) {
  return impl_->followTrajectory(request);
}

CoordinatedMove Machine::followPath(const motion::PathRequest& request) {
  return impl_->followPath(request);
}

double Machine::pathDuration(const motion::PathRequest& request,
                             const std::vector<double>& from) const {
  return impl_->pathDuration(request, from);
}

motion::PathAhead Machine::appendPath(const motion::PathAppend& request) {
  return impl_->appendPath(request);
}

std::optional<motion::PathAhead> Machine::pathAhead(std::uint64_t path) const {
  return impl_->pathAhead(path);
}

std::optional<CoordinatedResult> Machine::result(const CoordinatedMove& move) const {
  return impl_->result(move);
}

CoordinatedResult Machine::wait(const CoordinatedMove& move) const {
  std::optional<CoordinatedResult> result;
  impl_->shell_->wait([&] {
    result = impl_->result(move);
    return result.has_value();
  });
  return *result;
}

std::optional<CoordinatedResult> Machine::waitFor(const CoordinatedMove& move,
                                                  std::chrono::nanoseconds longest) const {
  std::optional<CoordinatedResult> result;
  const auto has_ended = [&] {
    result = impl_->result(move);
    return result.has_value();
  };
  impl_->shell_->waitFor(has_ended, longest);
  return result;
}

// All axes of a path stop with one of them.
void Machine::stop(const CoordinatedMove& move) {
  if (move.members.empty()) throw Refused("the motion has no axes");
  const CoordinatedMove::Member& first = move.members.front();
  axis(first.axis).stop(first.move);
}

void Machine::emergencyStop() {
  const std::uint64_t asked = impl_->engine_->emergencyStop();
  impl_->shell_->wakeUp();
  impl_->shell_->wait(
      [this, asked] { return impl_->shell_->snapshot()->stops_concluded >= asked; });
}

bool Machine::emergencyStopped() const { return impl_->engine_->emergencyStopped(); }

void Machine::recover() {
  // Before the inputs are read: they may be on a board that has failed.
  if (impl_->ports_ != nullptr) impl_->ports_->restore(*impl_->lines_);
  ask(*impl_->shell_, Recover{});
}

void Machine::enable(bool on) {
  Enable wanted{{}, on};
  for (AxisId id = 0; id < axes().size(); ++id) {
    const config::AxisConfig& config = axes()[id]->config();
    bool wired = true;
    for (std::size_t i = 0; i < config.motors(); ++i) {
      wired = wired && config.motorAt(i).hasSwitchedCurrent();
    }
    if (wired) wanted.axes.push_back(id);
  }
  if (wanted.axes.empty()) {
    throw Refused("no axis has pins/enable: the motors are energized as long as their drivers are");
  }
  ask(*impl_->shell_, std::move(wanted));
}

void Machine::setPositionCompare(const std::string& output,
                                 const config::PositionCompare& compare) {
  ask(*impl_->shell_, SetPositionCompare{output, compare});
}

void Machine::clearPositionCompare(const std::string& output) {
  ask(*impl_->shell_, SetPositionCompare{output, {}});
}

void Machine::setOutput(const std::string& name, bool on, double value) {
  ask(*impl_->shell_, SetOutput{name, on, value});
}

ProbeResult Machine::probe(const ProbeRequest& request, const std::function<bool()>& cancelled) {
  refuseBadProbing(request);
  return impl_->probe(*this, request, cancelled);
}

Latch Machine::latch(const LatchRequest& request) {
  BeginLatch begin = impl_->latchOf(request);
  Latch latch{begin.id, begin.record};
  ask(*impl_->shell_, std::move(begin));
  return latch;
}

LatchResult Machine::wait(const Latch& latch, const std::function<bool()>& cancelled) {
  bool ending = false;
  const auto over_or_cancelled = [&] {
    return latch.record->result() || (!ending && cancelled && cancelled());
  };
  impl_->shell_->wait(over_or_cancelled, static_cast<bool>(cancelled));
  if (!latch.record->result()) {
    ending = true;
    end(latch);
  }
  return *latch.record->result();
}

std::optional<LatchResult> Machine::waitFor(const Latch& latch,
                                            std::chrono::nanoseconds longest) const {
  impl_->shell_->waitFor([&] { return latch.record->result().has_value(); }, longest);
  return latch.record->result();
}

void Machine::end(const Latch& latch) { ask(*impl_->shell_, EndLatch{latch.id}); }

IoStates Machine::ioStates() const { return *impl_->shell_->snapshot()->io; }

void Machine::onIoChange(std::function<void(const IoStates&)> told) {
  const std::lock_guard<std::mutex> lock(impl_->io_mutex_);
  impl_->on_io_ = std::move(told);
}

void Machine::shutdown() { impl_->shutdown(); }

bool Machine::responds(std::chrono::nanoseconds longest) const {
  return impl_->shell_->responds(longest);
}

EngineFigures Machine::figures() const {
  const pulse::EngineState state = impl_->engine_->state();
  EngineFigures figures;
  figures.edges = 2 * state.pulses;
  figures.pulses = state.pulses;
  figures.slips = state.slips;
  figures.slipped = static_cast<double>(state.slipped) * 1e-9;
  figures.worst_lateness = static_cast<double>(state.worst_lateness) * 1e-9;
  figures.lateness = impl_->engine_->lateness();
  figures.lateness_last_second = impl_->engine_->latenessLastSecond();
  figures.realtime = impl_->shell_->rights().text();
  return figures;
}

std::string Machine::whyHung() const { return impl_->shell_->whyHung(); }
Recording Machine::recording() const { return impl_->recorder().recording(impl_->clock_); }

double Machine::recordedSeconds() const { return impl_->recorder().secondsAtTopSpeed(); }

void Machine::onFault(std::function<void()> told) {
  if (impl_->recorder_) impl_->recorder_->onFault(std::move(told));
}

std::string Machine::stateFileError() const {
  return impl_->keeper_ ? impl_->keeper_->error() : "";
}

void Machine::advance(double seconds) {
  impl_->shell_->advance(nanoseconds(seconds));
  if (impl_->keeper_) impl_->keeper_->keep();
}

}  // namespace stepdriver::machine
