#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "errors.h"
#include "latches.h"
#include "moves.h"
#include "requests.h"
#include "session.h"
#include "stepdriver_core/yaml.h"
#include "values.h"

// stepdriver_core._core: what the Python files of the package stand on. It has their values as
// dicts, and their axes by name.

namespace stepdriver::python {
namespace {

namespace py = pybind11;
using py::literals::operator""_a;
using SessionPointer = std::shared_ptr<Session>;
using Names = std::vector<std::string>;

// ---- making a machine ----

setup::BackendChoice backendChoice(std::optional<bool> simulated) {
  if (!simulated) return setup::BackendChoice::kAsInTheFile;
  return *simulated ? setup::BackendChoice::kSimulated : setup::BackendChoice::kLibgpiod;
}

// Something that isn't a map stays as it is: the reader of the configuration reports it.
void setIn(config::ConfigValue& tree, const std::string& map, const std::string& key,
           config::ConfigValue value) {
  auto* const top = tree.as<config::ConfigValue::Map>();
  if (top == nullptr) return;
  config::ConfigValue& inner = (*top)[map];
  if (inner.isNothing()) inner = config::ConfigValue::Map();
  if (auto* const own = inner.as<config::ConfigValue::Map>()) (*own)[key] = std::move(value);
}

SessionPointer openConfig(config::ConfigValue tree, std::optional<bool> simulated,
                          std::optional<double> speed, const std::string& trace, bool threaded) {
  if (speed) setIn(tree, "simulation", "speed", *speed);
  if (!trace.empty()) setIn(tree, "simulation", "trace", trace);
  const setup::MachineConfig config =
      setup::machineConfigOf(std::move(tree), backendChoice(simulated));
  if (!threaded && config.backend != setup::GpioBackend::kSimulated) {
    throw Refused("virtual time needs the simulated rig, but gpio/backend is libgpiod");
  }
  return std::make_shared<Session>(config, threaded);
}

config::ConfigValue loadFile(const std::string& path) {
  const py::gil_scoped_release without_gil;
  return yaml::load(path);
}

// ---- commands ----

// Calls `work` with the axis of that name.
template <typename Work>
auto onAxis(const Session& session, const std::string& name, const Work& work) {
  return session.run([&](OpenMachine& open) { return work(open.machine().axis(name)); });
}

MoveHandle moveTo(const SessionPointer& session, const std::string& name, double position,
                  bool relative, double velocity, bool shortest) {
  return {session, name, onAxis(*session, name, [=](axis::Axis& axis) {
            return axis.moveTo(position, relative, velocity, shortest);
          })};
}

MoveHandle moveRounds(const SessionPointer& session, const std::string& name, double rounds,
                      double velocity) {
  return {session, name, onAxis(*session, name, [=](axis::Axis& axis) {
            return axis.moveRounds(rounds, velocity);
          })};
}

py::dict planOf(const Session& session, const std::string& name, double position, bool relative,
                double velocity, bool shortest) {
  return valueOf(onAxis(session, name, [=](axis::Axis& axis) {
    return axis.plan(position, relative, velocity, shortest);
  }));
}

CoordinatedMoveHandle moveLine(const SessionPointer& session, const py::dict& positions,
                               bool relative, double velocity, double duration) {
  motion::LineRequest request;
  for (const machine::StreamMessage& one : messagesOf(positions, {})) {
    request.names.push_back(one.name);
    request.positions.push_back(one.value);
  }
  request.relative = relative;
  request.velocity = velocity;
  request.duration = duration;
  return {session,
          session->run([&](OpenMachine& open) { return open.machine().moveLine(request); })};
}

// How much earlier than at their places outputs are switched on and off [s].
using Leads = std::map<std::string, std::pair<double, double>>;

CoordinatedMoveHandle followPath(const SessionPointer& session, const Names& names,
                                 const py::iterable& segments, bool relative, double velocity,
                                 double tolerance, bool more_follows, const Leads& leads) {
  motion::PathRequest request{
      names, segmentsOf(segments, names), relative, velocity, tolerance, more_follows};
  for (const auto& [name, lead] : leads) request.leads.push_back({name, lead.first, lead.second});
  return {session,
          session->run([&](OpenMachine& open) { return open.machine().followPath(request); })};
}

CoordinatedMoveHandle followTrajectory(const SessionPointer& session, const Names& names,
                                       const py::object& times, const py::object& positions,
                                       const py::object& velocities,
                                       const py::object& accelerations, bool allow_slower,
                                       double begin_in) {
  const motion::TrajectoryRequest request{
      names, pointsOf(times, positions, velocities, accelerations), allow_slower, begin_in};
  return {session, session->run([&](OpenMachine& open) {
            return open.machine().followTrajectory(request);
          })};
}

// ---- homing ----

/// Asks Python for signals while a homing waits, as often as a person would notice. Only Python's
/// main thread has any.
class Interruption {
 public:
  /// For machine::Machine::home(): whether a signal handler has raised an exception.
  bool asked() {
    const auto now = std::chrono::steady_clock::now();
    if (now < next_) return false;
    next_ = now + std::chrono::milliseconds(50);
    const py::gil_scoped_acquire with_gil;
    if (PyErr_CheckSignals() == 0) return false;
    raised_.emplace();
    return true;
  }
  /// Raises it.
  void raise() const {
    if (raised_) throw py::error_already_set(*raised_);
  }

 private:
  std::chrono::steady_clock::time_point next_;
  std::optional<py::error_already_set> raised_;
};

py::list home(const Session& session, const Names& names) {
  Interruption interruption;
  const auto results = session.run([&](OpenMachine& open) {
    return open.machine().home(names, [&interruption] { return interruption.asked(); });
  });
  interruption.raise();
  py::list values;
  for (const axis::HomingResult& result : results) values.append(valueOf(result));
  return values;
}

// ---- streams ----

// Why axes don't move, by their names.
py::dict refusalsOf(const py::dict& values, const std::vector<std::string>& answers) {
  py::dict refusals;
  std::size_t i = 0;
  for (const auto& [name, value] : values) {
    const std::string& why = answers.at(i++);
    if (!why.empty()) refusals[name] = why;
  }
  return refusals;
}

py::dict jogAll(const Session& session, const py::dict& velocities, const py::dict& since) {
  const auto messages = messagesOf(velocities, since);
  return refusalsOf(velocities,
                    session.run([&](OpenMachine& open) { return open.machine().jog(messages); }));
}

py::dict followSetpoints(const Session& session, bool of_velocity, double timeout,
                         const py::dict& values, const py::dict& since) {
  const auto messages = messagesOf(values, since);
  const auto mode =
      of_velocity ? machine::SetpointMode::kVelocity : machine::SetpointMode::kPosition;
  return refusalsOf(values, session.run([&](OpenMachine& open) {
    return open.machine().followSetpoints(mode, timeout, messages);
  }));
}

// ---- what a machine is ----

py::dict configOfAxis(const config::AxisConfig& config) {
  return py::dict("name"_a = config.name, "unit"_a = config::unitOf(config.kind),
                  "min_position"_a = config.min_position, "max_position"_a = config.max_position,
                  "continuous"_a = config.continuous, "driver"_a = config.driverTitles());
}

py::list axesOf(const Session& session) {
  const auto configs = session.run([](OpenMachine& open) {
    std::vector<config::AxisConfig> found;
    for (const auto& axis : open.machine().axes()) found.push_back(axis->config());
    return found;
  });
  py::list axes;
  for (const config::AxisConfig& config : configs) axes.append(configOfAxis(config));
  return axes;
}

// The states of the outputs, or of the inputs, by their names.
template <typename State>
py::dict byName(const std::vector<State>& states) {
  py::dict values;
  for (const State& state : states) values[py::str(state.name)] = valueOf(state);
  return values;
}

machine::IoStates ioStatesOf(const Session& session) {
  return session.run([](OpenMachine& open) { return open.machine().ioStates(); });
}

py::dict outputsOf(const Session& session) { return byName(ioStatesOf(session).outputs); }
py::dict inputsOf(const Session& session) { return byName(ioStatesOf(session).inputs); }

// The values of Python's set_position_compare(), for the output of a name.
void setPositionCompare(const Session& session, const std::string& output, const std::string& axis,
                        int direction, const std::vector<std::pair<double, double>>& cams,
                        const std::vector<double>& places,
                        const std::optional<std::tuple<double, double, double>>& every, bool at_end,
                        const std::map<std::string, double>& times) {
  using config::PositionCompare;
  PositionCompare compare;
  compare.axis = axis;
  if (direction != 0) {
    compare.direction =
        direction > 0 ? PositionCompare::Direction::kUp : PositionCompare::Direction::kDown;
  }
  for (const auto& [from, to] : cams) compare.cams.push_back({from, to});
  compare.places = places;
  if (every) {
    const auto& [distance, from, to] = *every;
    compare.every = PositionCompare::Every{distance, from, to};
  }
  compare.at_end = at_end;
  const auto nanoseconds = [&times](const char* name) {
    constexpr double kMost = 10.0;
    const double seconds = times.at(name);
    if (seconds >= 0.0 && seconds <= kMost) return std::llround(seconds * 1e9);
    throw Refused(std::string(name) + " is " + std::string(py::repr(py::float_(seconds))) +
                  " s, but must be 0 to 10 s");
  };
  compare.pulse_ns = nanoseconds("pulse");
  compare.lead_on_ns = nanoseconds("lead_on");
  compare.lead_off_ns = nanoseconds("lead_off");
  session.run([&](OpenMachine& open) { open.machine().setPositionCompare(output, compare); });
}

// ---- edges ----

LatchHandle latch(const SessionPointer& session, const std::string& input, const std::string& edge,
                  bool every, const Names& axes,
                  const std::optional<std::tuple<std::string, double, double>>& window) {
  machine::LatchRequest request;
  request.input = input;
  request.edge = edge == "active"     ? machine::LatchEdge::kActive
                 : edge == "inactive" ? machine::LatchEdge::kInactive
                                      : machine::LatchEdge::kEither;
  request.every = every;
  request.axes = axes;
  if (window) {
    const auto& [axis, from, to] = *window;
    request.window = machine::LatchWindow{axis, from, to};
  }
  return {session, session->run([&](OpenMachine& open) { return open.machine().latch(request); })};
}

py::dict probe(const Session& session, const std::string& input, const py::dict& positions,
               const std::map<std::string, bool>& manner,
               const std::map<std::string, double>& values) {
  machine::ProbeRequest request;
  request.input = input;
  for (const machine::StreamMessage& one : messagesOf(positions, {})) {
    request.names.push_back(one.name);
    request.positions.push_back(one.value);
  }
  request.relative = manner.at("relative");
  request.away = manner.at("away");
  request.must = manner.at("must");
  request.returns = manner.at("go_back");
  request.velocity = values.at("velocity");
  request.second_velocity = values.at("second_velocity");
  request.back_off = values.at("back_off");
  Interruption interruption;
  const machine::ProbeResult result = session.run([&](OpenMachine& open) {
    return open.machine().probe(request, [&interruption] { return interruption.asked(); });
  });
  interruption.raise();
  return valueOf(result);
}

setup::Simulation& simulationOf(OpenMachine& open) {
  setup::Simulation* const simulation = open.hardware().simulation();
  if (simulation == nullptr) throw Refused("there is no rig: the machine drives GPIO lines");
  return *simulation;
}

constexpr double kLongestAdvance = 3600.0;  // [s]

void advance(const Session& session, double seconds) {
  if (session.isThreaded()) {
    throw Refused(
        "only a machine in virtual time can be advanced: this one's time passes by itself");
  }
  if (!(seconds >= 0.0 && seconds <= kLongestAdvance)) {
    throw Refused("the time to advance by is " + std::string(py::repr(py::float_(seconds))) +
                  " s, but must be from 0 to 3600 s");
  }
  session.run([seconds](OpenMachine& open) {
    // It reads the inputs at the begin of each: nothing else does.
    constexpr std::int64_t kAtOnce = 1'000'000;
    for (std::int64_t left = std::llround(seconds * 1e9); left > 0; left -= kAtOnce) {
      open.machine().advance(static_cast<double>(std::min(left, kAtOnce)) * 1e-9);
    }
  });
}

void pressEndstop(const Session& session, const std::string& name, bool at_max, bool pressed) {
  using End = setup::Simulation::End;
  session.run([&](OpenMachine& open) {
    open.machine().axis(name);  // says which axes there are
    simulationOf(open).pressEndstop(name, at_max ? End::kMax : End::kMin, pressed);
  });
}

py::dict reportOf(const Session& session, const std::string& name) {
  return valueOf(session.run([&](OpenMachine& open) {
    open.machine().axis(name);
    return simulationOf(open).rig().report(name);
  }));
}

// ---- bindings ----

void bindLatches(py::module_& module) {
  py::class_<LatchHandle>(module, "LatchHandle")
      .def("take",
           [](const LatchHandle& self) {
             py::list edges;
             for (const machine::LatchedEdge& edge : self.take()) edges.append(valueOf(edge));
             return edges;
           })
      .def("result", [](const LatchHandle& self) { return valueOf(self.result()); })
      .def(
          "wait",
          [](const LatchHandle& self, std::optional<double> longest) {
            return valueOf(self.wait(longest));
          },
          "longest"_a)
      .def("end", &LatchHandle::end);
}

void bindMoves(py::module_& module) {
  py::class_<MoveHandle>(module, "MoveHandle")
      .def_property_readonly("target", [](const MoveHandle& self) { return self.move().target; })
      .def_property_readonly("rest", [](const MoveHandle& self) { return self.move().rest; })
      .def_property_readonly("duration",
                             [](const MoveHandle& self) { return self.move().duration; })
      .def_property_readonly("overshoot",
                             [](const MoveHandle& self) { return self.move().overshoot; })
      .def("result", [](const MoveHandle& self) { return valueOf(self.result()); })
      .def(
          "wait",
          [](const MoveHandle& self, std::optional<double> longest) {
            return valueOf(self.wait(longest));
          },
          "longest"_a)
      .def("stop", &MoveHandle::stop);
  py::class_<CoordinatedMoveHandle>(module, "CoordinatedMoveHandle")
      .def_property_readonly("targets",
                             [](const CoordinatedMoveHandle& self) {
                               py::dict targets;
                               for (const auto& member : self.move().members) {
                                 targets[py::str(member.axis)] = member.move.target;
                               }
                               return targets;
                             })
      .def_property_readonly("duration",
                             [](const CoordinatedMoveHandle& self) { return self.move().duration; })
      .def("result", [](const CoordinatedMoveHandle& self) { return valueOf(self.result()); })
      .def(
          "wait",
          [](const CoordinatedMoveHandle& self, std::optional<double> longest) {
            return valueOf(self.wait(longest));
          },
          "longest"_a)
      .def("stop", &CoordinatedMoveHandle::stop)
      .def(
          "append",
          [](const CoordinatedMoveHandle& self, const py::iterable& segments, bool more_follows) {
            return valueOf(self.append(segments, more_follows));
          },
          "segments"_a, "more_follows"_a)
      .def("ahead", [](const CoordinatedMoveHandle& self) { return valueOf(self.ahead()); });
}

using SessionClass = py::class_<Session, SessionPointer>;

// A method of an axis that returns nothing.
template <typename... Arguments>
auto command(void (axis::Axis::*method)(Arguments...)) {
  return [method](const Session& session, const std::string& name, Arguments... arguments) {
    onAxis(session, name, [&](axis::Axis& axis) { (axis.*method)(arguments...); });
  };
}

// A method of a machine that returns nothing.
template <typename... Arguments>
auto command(void (machine::Machine::*method)(Arguments...)) {
  return [method](const Session& session, Arguments... arguments) {
    session.run([&](OpenMachine& open) { (open.machine().*method)(arguments...); });
  };
}

void bindAxes(SessionClass& session) {
  session.def("axes", &axesOf)
      .def("move_to", &moveTo, "axis"_a, "position"_a, "relative"_a, "velocity"_a, "shortest"_a)
      .def("move_rounds", &moveRounds, "axis"_a, "rounds"_a, "velocity"_a)
      .def("plan", &planOf, "axis"_a, "position"_a, "relative"_a, "velocity"_a, "shortest"_a)
      .def("jog", command(&axis::Axis::jog), "axis"_a, "velocity"_a, "unless_stopped_since"_a)
      .def("stop_axis", command(static_cast<void (axis::Axis::*)()>(&axis::Axis::stop)), "axis"_a)
      .def("enable", command(&axis::Axis::enable), "axis"_a, "on"_a)
      .def("sleep", command(&axis::Axis::sleep), "axis"_a, "asleep"_a)
      .def("reset", command(&axis::Axis::reset), "axis"_a)
      .def("set_microsteps", command(&axis::Axis::setMicrosteps), "axis"_a, "microsteps"_a)
      .def("set_position", command(&axis::Axis::setPosition), "axis"_a, "position"_a)
      .def(
          "set_limits",
          [](const Session& self, const std::string& name, double max_speed, double acceleration,
             double deceleration, double jerk) {
            onAxis(self, name, [=](axis::Axis& axis) {
              axis.setLimits({max_speed, acceleration, deceleration, jerk});
            });
          },
          "axis"_a, "max_speed"_a, "acceleration"_a, "deceleration"_a, "jerk"_a)
      .def("set_current", command(&axis::Axis::setCurrent), "axis"_a, "run"_a, "hold"_a)
      .def("set_stall_threshold", command(&axis::Axis::setStallThreshold), "axis"_a, "threshold"_a)
      .def(
          "limits",
          [](const Session& self, const std::string& name) {
            return valueOf(onAxis(self, name, [](axis::Axis& axis) { return axis.limits(); }));
          },
          "axis"_a)
      .def(
          "state",
          [](const Session& self, const std::string& name) {
            return valueOf(onAxis(self, name, [](axis::Axis& axis) { return axis.state(); }));
          },
          "axis"_a)
      .def(
          "endstops",
          [](const Session& self, const std::string& name) {
            return valueOf(onAxis(self, name, [](axis::Axis& axis) { return axis.endstops(); }));
          },
          "axis"_a);
}

void bindMachine(SessionClass& session) {
  using machine::Machine;
  session.def("home", &home, "axes"_a)
      .def("move_line", &moveLine, "positions"_a, "relative"_a, "velocity"_a, "duration"_a)
      .def("follow_path", &followPath, "axes"_a, "segments"_a, "relative"_a, "velocity"_a,
           "tolerance"_a, "more_follows"_a, "leads"_a)
      .def("follow_trajectory", &followTrajectory, "axes"_a, "times"_a, "positions"_a,
           "velocities"_a, "accelerations"_a, "allow_slower"_a, "begin_in"_a)
      .def("jog_all", &jogAll, "velocities"_a, "since"_a)
      .def("follow_setpoints", &followSetpoints, "of_velocity"_a, "timeout"_a, "values"_a,
           "since"_a)
      .def("stop", command(static_cast<void (Machine::*)()>(&Machine::stop)))
      .def("hold", command(&Machine::hold))
      .def("resume", command(&Machine::resume))
      .def("set_speed_override", command(&Machine::setSpeedOverride), "factor"_a)
      .def("emergency_stop", command(&Machine::emergencyStop))
      .def("recover", command(&Machine::recover))
      .def("emergency_stopped",
           [](const Session& self) {
             return self.run([](OpenMachine& open) { return open.machine().emergencyStopped(); });
           })
      .def("set_output", command(&Machine::setOutput), "name"_a, "on"_a, "value"_a)
      .def("set_position_compare", &setPositionCompare, "output"_a, "axis"_a, "direction"_a,
           "cams"_a, "places"_a, "every"_a, "at_end"_a, "times"_a)
      .def("clear_position_compare", command(&Machine::clearPositionCompare), "output"_a)
      .def("latch", &latch, "input"_a, "edge"_a, "every"_a, "axes"_a, "window"_a)
      .def("probe", &probe, "input"_a, "positions"_a, "manner"_a, "values"_a)
      .def("outputs", &outputsOf)
      .def("inputs", &inputsOf)
      .def("figures",
           [](const Session& self) {
             return valueOf(self.run([](OpenMachine& open) { return open.machine().figures(); }));
           })
      .def("description",
           [](const Session& self) {
             return self.run([](OpenMachine& open) { return open.hardware().description(); });
           })
      .def("time",
           [](const Session& self) {
             return self.run([](OpenMachine& open) {
               return static_cast<double>(open.hardware().clock().now()) * 1e-9;
             });
           })
      .def("advance", &advance, "seconds"_a)
      .def("close", &Session::close)
      .def_property_readonly("is_open", &Session::isOpen)
      .def_property_readonly("is_threaded", &Session::isThreaded);
}

void bindRig(SessionClass& session) {
  session.def("rig_report", &reportOf, "axis"_a)
      .def("press_endstop", &pressEndstop, "axis"_a, "at_max"_a, "pressed"_a)
      .def(
          "press_input",
          [](const Session& self, const std::string& name, bool pressed) {
            self.run([&](OpenMachine& open) { simulationOf(open).pressInput(name, pressed); });
          },
          "name"_a, "pressed"_a)
      .def(
          "press_emergency_stop",
          [](const Session& self, bool pressed) {
            self.run([=](OpenMachine& open) { simulationOf(open).pressEmergencyStop(pressed); });
          },
          "pressed"_a);
}

}  // namespace
}  // namespace stepdriver::python

PYBIND11_MODULE(_core, module) {
  using namespace stepdriver::python;  // NOLINT
  module.doc() = "The compiled part of stepdriver_core; use that instead.";
  module.attr("__version__") = STEPDRIVER_VERSION;
  translateErrors();
  bindMoves(module);
  bindLatches(module);
  SessionClass session(module, "Session");
  bindAxes(session);
  bindMachine(session);
  bindRig(session);
  module.def(
      "open_file",
      [](const std::string& path, std::optional<bool> simulated, std::optional<double> speed,
         const std::string& trace,
         bool threaded) { return openConfig(loadFile(path), simulated, speed, trace, threaded); },
      "path"_a, "simulated"_a, "speed"_a, "trace"_a, "threaded"_a);
  module.def(
      "open_config",
      [](const py::dict& config, std::optional<bool> simulated, std::optional<double> speed,
         const std::string& trace,
         bool threaded) { return openConfig(configOf(config), simulated, speed, trace, threaded); },
      "config"_a, "simulated"_a, "speed"_a, "trace"_a, "threaded"_a);
  py::module_::import("atexit").attr("register")(py::cpp_function(&Session::closeAll));
}
