#include "stepdriver_core/machine/machine.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "home_in_order.h"
#include "state_keeper.h"
#include "stepdriver_core/axis/coordination.h"
#include "stepdriver_core/axis/edge_log.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/chip_table.h"
#include "stepdriver_core/machine/step_rates.h"
#include "stepdriver_core/pulse/pulse_driver.h"
#include "stepdriver_core/pulse/pulse_engine.h"
#include "wiring.h"

namespace stepdriver::machine {
namespace {

constexpr std::int64_t kInputPeriodNs = 100'000'000;
constexpr double kLeastOverride = 0.01;
constexpr double kMostOverride = 2.0;

pulse::Nanoseconds nanoseconds(double seconds) { return std::llround(seconds * 1e9); }

bool anyGoesIdle(const std::vector<axis::AxisConfig>& axes) {
  return std::any_of(axes.begin(), axes.end(),
                     [](const axis::AxisConfig& axis) { return axis.idle_timeout > 0.0; });
}

}  // namespace

class Machine::Impl {
 public:
  Impl(const std::vector<axis::AxisConfig>& configs, gpio::Backend& backend, pulse::Clock& clock,
       const MachineOptions& options) {
    if (!options.state_file.empty()) keeper_ = std::make_unique<StateKeeper>(options.state_file);
    const Wiring wiring(configs, options.emergency_stop);
    emergency_stop_ = wiring.emergency_stop;
    lines_ = backend.request(wiring.outputs, wiring.inputs);
    if (options.measure && clock.realtime()) {
      capability_ =
          pulse::measureCapability(*lines_, clock, wiring.channels, options.latency_device);
      const std::string why = options.enforce ? whyNotInRealtime(configs, *capability_) : "";
      if (!why.empty()) throw Refused(why);
    }
    engine_ = std::make_unique<pulse::PulseEngine>(
        *lines_, clock, wiring.channels, nanoseconds(options.max_lateness), wiring.emergency_stop);
    driver_ = std::make_unique<pulse::PulseDriver>(*engine_, clock, options.threaded,
                                                   options.latency_device);
    edges_ = std::make_unique<axis::EdgeLog>(*lines_, options.threaded);
    for (std::size_t i = 0; i < configs.size(); ++i) {
      axes_.push_back(std::make_unique<axis::Axis>(configs[i], static_cast<int>(i),
                                                   wiring.axis_lines[i], *lines_, *edges_, *driver_,
                                                   planning_));
    }
    for (const auto& axis : axes_) axis->bringUp();
    if (keeper_) keeper_->start(axes_, options.threaded);
    if (options.threaded && (!wiring.inputs.empty() || anyGoesIdle(configs)))
      watcher_ = std::thread([this] { watchInputs(); });
  }

  ~Impl() {
    try {
      shutdown();
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): told to whoever calls shutdown()
    }
    stopWatching();
    driver_->stop();
  }

  axis::Axis& axis(const std::string& name) const {
    std::string names;
    for (const auto& axis : axes_) {
      if (axis->config().name == name) return *axis;
      names += (names.empty() ? "" : ", ") + axis->config().name;
    }
    throw Refused("there is no axis " + name + "; there are " + names);
  }

  CoordinatedMove moveLine(const LineRequest& request) {
    const std::vector<axis::Axis*> axes = axesOf(request.names);
    if (request.positions.size() != axes.size()) {
      throw Refused("there are " + std::to_string(axes.size()) + " names, but " +
                    std::to_string(request.positions.size()) + " positions");
    }
    return moveOf(request.names,
                  axis::Coordination::moveLine(axes, request.positions, request.relative,
                                               request.velocity, request.duration));
  }

  CoordinatedMove followTrajectory(const TrajectoryRequest& request) {
    return moveOf(request.names, axis::Coordination::follow(axesOf(request.names), request.points));
  }

  std::vector<axis::Axis*> axesOf(const std::vector<std::string>& names) const {
    if (names.empty()) throw Refused("no axis is named");
    std::vector<axis::Axis*> axes;
    for (const std::string& name : names) {
      axes.push_back(&axis(name));
      if (std::find(axes.begin(), axes.end() - 1, axes.back()) != axes.end() - 1) {
        throw Refused("the axis " + name + " is named twice");
      }
    }
    return axes;
  }

  std::vector<axis::Axis*> axesToHome(const std::vector<std::string>& names) const {
    if (!names.empty()) return axesOf(names);
    std::vector<axis::Axis*> axes;
    for (const auto& axis : axes_) {
      if (axis->config().homing) axes.push_back(axis.get());
    }
    if (axes.empty()) throw Refused("no axis has a homing");
    return axes;
  }

  static CoordinatedMove moveOf(const std::vector<std::string>& names,
                                const std::vector<axis::Move>& moves) {
    CoordinatedMove move;
    for (std::size_t i = 0; i < names.size(); ++i) {
      move.members.push_back({names[i], moves[i]});
      move.duration = std::max(move.duration, moves[i].duration);
    }
    return move;
  }

  std::optional<CoordinatedResult> result(const CoordinatedMove& move) const {
    CoordinatedResult result;
    int worst = -1;
    for (const CoordinatedMove::Member& member : move.members) {
      const auto own = axis(member.axis).result(member.move);
      if (!own) return std::nullopt;
      result.positions.push_back(own->position);
      result.duration = std::max(result.duration, own->duration);
      // What ended the first of them says more than that it took the others along.
      const int weight = own->end == axis::MoveEnd::kReached     ? 0
                         : own->end == axis::MoveEnd::kCompanion ? 1
                                                                 : 2;
      if (weight <= worst) continue;
      worst = weight;
      result.end = own->end;
      result.message = own->message;
    }
    if (result.end == axis::MoveEnd::kReached) result.message = "all axes reached their targets";
    return result;
  }

  void shutdown() {
    if (shut_.exchange(true)) return;
    for (const auto& axis : axes_) axis->close("the machine was shut down");
    // With its current a motor may lose the trust in its position. That is known of it, and what
    // the next start makes of it is decided there.
    driver_->waitFor([this] {
      return std::none_of(axes_.begin(), axes_.end(),
                          [](const auto& axis) { return axis->state().moving; });
    });
    if (keeper_) keeper_->close();
    forAll([](axis::Axis& axis) { axis.shutDown(); });
    if (keeper_ && !keeper_->error().empty()) throw Error(keeper_->error());
  }

  // An edge is only a wake-up: the engine reads the levels. One that was lost, or a chip that was
  // waking when it came, is made good by asking again after a while.
  void watchInputs() {
    while (!watching_ended_) {
      const int count = edges_->watch(kInputPeriodNs);
      // Where waiting fails, reading will fail too, and say so.
      if (count < 0) std::this_thread::sleep_for(std::chrono::nanoseconds(kInputPeriodNs));
      engine_->inputsChanged();
      supervise();
    }
  }

  // What falls due by time alone. @return the clock time at which it wants to be called again.
  pulse::Nanoseconds supervise() {
    pulse::Nanoseconds due = pulse::kNever;
    for (const auto& axis : axes_) due = std::min(due, axis->supervise());
    return due;
  }

  void stopWatching() {
    if (!watcher_.joinable()) return;
    watching_ended_ = true;
    lines_->interrupt();
    watcher_.join();
  }

  void refuseWhileEmergencyStopInput() const {
    if (!emergency_stop_) return;
    const int level = lines_->read(emergency_stop_->line);
    const std::string input =
        "the emergency stop input " + lines_->inputName(emergency_stop_->line);
    if (level < 0) throw Refused(input + " can't be read: " + gpio::errorText(-level));
    if ((level != 0) == emergency_stop_->active) throw Refused(input + " is active; release it");
  }

  // Does it for each axis, whatever happens to the others, and then tells all that went wrong.
  void forAll(const std::function<void(axis::Axis&)>& action) {
    std::string errors;
    for (const auto& axis : axes_) {
      try {
        action(*axis);
      } catch (const Error& error) {
        errors += (errors.empty() ? "" : "; ") + std::string(error.what());
      }
    }
    if (!errors.empty()) throw Error(errors);
  }

  // What is wrong with a motion of several axes is said once.
  void forEachMotion(const std::function<void(axis::Axis&)>& action) {
    forAll([&action](axis::Axis& axis) {
      if (axis::Coordination::leads(axis)) action(axis);
    });
  }

  // In the order in which they must go: axes, driver, engine, lines.
  std::unique_ptr<gpio::Lines> lines_;
  std::optional<pulse::Signal> emergency_stop_;
  std::unique_ptr<axis::EdgeLog> edges_;
  std::optional<pulse::Capability> capability_;
  std::unique_ptr<pulse::PulseEngine> engine_;
  std::unique_ptr<pulse::PulseDriver> driver_;
  std::mutex planning_;  // of all axes
  std::vector<std::unique_ptr<axis::Axis>> axes_;
  std::unique_ptr<StateKeeper> keeper_;
  std::atomic<bool> shut_{false};
  std::atomic<bool> watching_ended_{false};
  std::thread watcher_;
};

Machine::Machine(const std::vector<axis::AxisConfig>& axes, gpio::Backend& backend,
                 pulse::Clock& clock, const MachineOptions& options)
    : impl_(std::make_unique<Impl>(axes, backend, clock, options)) {}

Machine::~Machine() = default;

const std::vector<std::unique_ptr<axis::Axis>>& Machine::axes() const { return impl_->axes_; }

axis::Axis& Machine::axis(const std::string& name) const { return impl_->axis(name); }

const std::optional<pulse::Capability>& Machine::capability() const { return impl_->capability_; }

void Machine::stop() {
  impl_->forAll([](axis::Axis& axis) { axis.stop(); });
}

void Machine::hold() {
  impl_->forEachMotion([](axis::Axis& axis) { axis.hold(); });
}

void Machine::resume() {
  impl_->forEachMotion([](axis::Axis& axis) { axis.resume(); });
}

std::vector<axis::HomingResult> Machine::home(const std::vector<std::string>& names,
                                              const std::function<bool()>& cancelled) {
  checkHoming(names);
  return homeInOrder(impl_->axesToHome(names), cancelled);
}

void Machine::checkHoming(const std::vector<std::string>& names) const {
  for (const axis::Axis* axis : impl_->axesToHome(names)) axis->checkHoming();
}

void Machine::setSpeedOverride(double factor) {
  if (!(factor >= kLeastOverride && factor <= kMostOverride)) {
    char text[96];
    std::snprintf(text, sizeof text, "the speed override is %.9g, but must be from %g to %g",
                  factor, kLeastOverride, kMostOverride);
    throw Refused(text);
  }
  impl_->forAll([factor](axis::Axis& axis) { axis.setSpeedOverride(factor); });
}

CoordinatedMove Machine::moveLine(const LineRequest& request) { return impl_->moveLine(request); }

CoordinatedMove Machine::followTrajectory(const TrajectoryRequest& request) {
  return impl_->followTrajectory(request);
}

std::optional<CoordinatedResult> Machine::result(const CoordinatedMove& move) const {
  return impl_->result(move);
}

CoordinatedResult Machine::wait(const CoordinatedMove& move) const {
  std::optional<CoordinatedResult> result;
  impl_->driver_->waitFor([&] {
    result = impl_->result(move);
    return result.has_value();
  });
  return *result;
}

void Machine::emergencyStop() {
  impl_->engine_->emergencyStop();
  impl_->forAll([](axis::Axis& axis) { axis.noteEmergencyStop(); });
}

bool Machine::emergencyStopped() const { return impl_->engine_->emergencyStopped(); }

void Machine::recover() {
  impl_->refuseWhileEmergencyStopInput();
  impl_->engine_->clearEmergencyStop();
  impl_->engine_->inputsChanged();
  impl_->forAll([](axis::Axis& axis) { axis.recover(); });
}

void Machine::shutdown() { impl_->shutdown(); }

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
  figures.realtime = impl_->driver_->rights().text();
  return figures;
}

std::string Machine::stateFileError() const {
  return impl_->keeper_ ? impl_->keeper_->error() : "";
}

void Machine::advance(double seconds) {
  impl_->engine_->inputsChanged();  // nobody watches them
  pulse::Clock& clock = impl_->driver_->clock();
  const pulse::Nanoseconds end = clock.now() + nanoseconds(seconds);
  for (;;) {
    const pulse::Nanoseconds due = std::min(end, impl_->supervise());
    impl_->driver_->advance(due - clock.now());
    if (clock.now() >= end) break;
  }
  impl_->supervise();
  if (impl_->keeper_) impl_->keeper_->keep();
}

}  // namespace stepdriver::machine
