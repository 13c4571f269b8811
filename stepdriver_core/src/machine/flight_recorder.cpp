#include "flight_recorder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "gpio/chip_table.h"
#include "message_text.h"
#include "nanoseconds.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

constexpr std::size_t kEvents = 4096;
// Enough for ten seconds in which every axis is enabled and disabled, and changes its microsteps.
constexpr std::size_t kOtherEdges = 8192;
constexpr std::size_t kFewestEdges = 4096;
constexpr double kBytesPerEdge = 8.0;

/// [1/s] Edges of all STEP lines at the top speeds, and of the heartbeat.
double edgesPerSecond(const std::vector<config::AxisConfig>& axes, const Wiring& wiring) {
  double rate = wiring.heartbeat ? 1e9 / static_cast<double>(wiring.heartbeat->interval) : 0.0;
  for (const config::AxisConfig& axis : axes) {
    const double edges_of_a_step = axis.stepsOnBothEdges() ? 1.0 : 2.0;
    rate +=
        edges_of_a_step * axis.max_speed * axis.steps_per_unit * static_cast<double>(axis.motors());
  }
  return rate;
}

std::size_t edgesToKeep(const std::vector<config::AxisConfig>& axes, const Wiring& wiring,
                        const FlightRecorder::Options& options) {
  // A tenth more for DIR.
  const double wanted = 1.1 * options.seconds * edgesPerSecond(axes, wiring);
  const double most = static_cast<double>(options.bytes) / kBytesPerEdge;
  return std::max(kFewestEdges, static_cast<std::size_t>(std::min(wanted, most)));
}

std::vector<bool> levelsOf(const Wiring& wiring) {
  if (wiring.outputs.size() > pulse::PinRing::kMostOutputs) {
    throw Refused(
        fmt::format("there are {} output lines, but the flight recorder takes at most {}; set "
                    "recorder/seconds to 0",
                    wiring.outputs.size(), pulse::PinRing::kMostOutputs));
  }
  return wiring.safeLevels();
}

void addPins(const config::AxisConfig& axis, std::size_t motor, const motor::MotorLines& all_lines,
             std::vector<Recording::Pin>& pins) {
  const driver::DriverChip& chip = axis.motorAt(motor).driver;
  const config::Pins& own = axis.motorAt(motor).pins;
  const motor::ChipLines& lines = all_lines.motorAt(motor);
  const std::string scope = axis.traceName(motor);
  // A line whose level the chip doesn't know isn't wired.
  const auto add = [&](const char* name, int output, const config::Pin& pin,
                       std::optional<bool> at_chip) {
    if (output < 0) return;
    pins.push_back({scope, name, output, at_chip.value_or(true) != pin.inverted});
    pins.back().both_edges = output == lines.step && chip.both_edges;
  };
  const bool cw_ccw = all_lines.cw_ccw;
  add(cw_ccw ? "cw" : "step", lines.step, own.step, chip.step_active);
  add(cw_ccw ? "ccw" : "dir", lines.dir, own.dir, chip.step_active || !cw_ccw);
  add("enable", lines.enable, own.enable, chip.enable_on);
  add("ms1", lines.mode[0], own.ms1, true);
  add("ms2", lines.mode[1], own.ms2, true);
  add("ms3", lines.mode[2], own.ms3, true);
  add("sleep", lines.sleep, own.sleep, chip.sleep_asleep);
  add("reset", lines.reset, own.reset, chip.reset_held);
  add("in1", lines.coils[0], own.in1, true);
  add("in2", lines.coils[1], own.in2, true);
  add("in3", lines.coils[2], own.in3, true);
  add("in4", lines.coils[3], own.in4, true);
}

std::vector<Recording::Pin> pinsOf(const std::vector<config::AxisConfig>& axes,
                                   const Wiring& wiring,
                                   const std::vector<config::OutputConfig>& outputs) {
  std::vector<Recording::Pin> pins;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const config::AxisConfig& axis = axes[i];
    const motor::MotorLines& lines = wiring.motor_lines[i];
    for (std::size_t motor = 0; motor < lines.motors(); ++motor) {
      addPins(axis, motor, lines, pins);
    }
    if (axis.brake) {
      pins.push_back({axis.name, "brake", lines.brake, !axis.brake->release_level});
    }
  }
  if (wiring.motor_power) {
    pins.push_back({"machine", "motor_power", wiring.motor_power->output, true});
  }
  if (wiring.heartbeat) pins.push_back({"machine", "heartbeat", wiring.heartbeat->output, true});
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    pins.push_back({"outputs", outputs[i].name, wiring.named_outputs[i], outputs[i].active_level});
  }
  return pins;
}

/// How a request was answered, in words.
std::string outcomeText(const activity::Reply& reply) {
  if (!reply.failure) return "accepted";
  const bool refused = reply.failure->kind == activity::Failure::Kind::kRefused;
  return (refused ? "refused: " : "failed: ") + reply.failure->text;
}

/// The edges of both rings from a time on, in their order.
std::vector<Recording::Edge> edgesOf(const pulse::PinRing::Copy& steps,
                                     const pulse::PinRing::Copy& others, pulse::Nanoseconds begin) {
  std::vector<Recording::Edge> edges;
  for (const pulse::PinRing::Copy* ring : {&steps, &others}) {
    for (const pulse::PinRing::Edge& edge : ring->edges) {
      if (edge.time >= begin) edges.push_back({edge.time, edge.output, edge.level});
    }
  }
  std::stable_sort(edges.begin(), edges.end(),
                   [](const auto& a, const auto& b) { return a.time < b.time; });
  return edges;
}

/// Gives each output with an edge the level that it had before the first one, and leaves out what
/// is no edge: an output that both rings have may be written again as it is.
void addEdges(const std::vector<Recording::Edge>& edges, Recording& recording) {
  std::vector<int> level(recording.levels.size(), -1);
  for (const Recording::Edge& edge : edges) {
    int& known = level[static_cast<std::size_t>(edge.output)];
    if (known < 0) recording.levels[static_cast<std::size_t>(edge.output)] = !edge.level;
    if (known != static_cast<int>(edge.level)) recording.edges.push_back(edge);
    known = static_cast<int>(edge.level);
  }
}

/// How a profile of the engine ended: "reached its end".
const char* textOf(pulse::EndReason reason) {
  switch (reason) {
    case pulse::EndReason::kDone:
      return "reached its end";
    case pulse::EndReason::kEndstopMin:
      return "met the min endstop";
    case pulse::EndReason::kEndstopMax:
      return "met the max endstop";
    case pulse::EndReason::kEmergencyStop:
      return "was ended by an emergency stop";
    case pulse::EndReason::kChipFault:
      return "was ended by a fault of the driver chip";
    case pulse::EndReason::kTooLate:
      return "was ended because a pulse was too late";
    case pulse::EndReason::kLineError:
      return "was ended by a line that failed";
    case pulse::EndReason::kNotInPosition:
      return "was not in position in time after its end";
    case pulse::EndReason::kSkewed:
      return "was ended because its motors got too far apart";
    case pulse::EndReason::kBlocked:
      return "was ended because the motor was blocked";
    case pulse::EndReason::kCompanion:
      return "was ended together with another axis";
  }
  return "ended";
}

}  // namespace

FlightRecorder::FlightRecorder(const std::vector<config::AxisConfig>& axes, const Wiring& wiring,
                               axis::LineNames names, pulse::Nanoseconds now,
                               const Options& options)
    : axes_(axes),
      names_(std::move(names)),
      started_(now),
      length_(nanoseconds(options.seconds)),
      pins_(pinsOf(axes, wiring, options.outputs)),
      pulse_ring_(levelsOf(wiring), edgesToKeep(axes, wiring, options)),
      other_ring_(levelsOf(wiring), kOtherEdges),
      switched_(wiring.outputs.size()),
      events_(kEvents) {
  for (const int output : wiring.named_outputs) switched_[static_cast<std::size_t>(output)] = true;
  const double rate = edgesPerSecond(axes, wiring);
  const auto most = static_cast<double>(edgesToKeep(axes, wiring, options));
  seconds_at_top_speed_ = std::min(options.seconds, most / std::max(rate, 1e-9));
}

// ---- what is noted ----

void FlightRecorder::note(pulse::Nanoseconds time, const std::string& text) {
  EventRing::Record record{static_cast<std::uint64_t>(time)};
  constexpr std::size_t kMost = kTextWords * sizeof(std::uint64_t);
  std::string shown = text;
  std::replace(shown.begin(), shown.end(), '\n', ' ');
  if (shown.size() > kMost) shown = shown.substr(0, kMost - 3) + "...";
  std::memcpy(&record[1], shown.data(), shown.size());
  events_.add(record);
}

void FlightRecorder::addInput(const Input& input) {
  if (input.slipped != slipped_) {
    note(input.now, fmt::format("pulses were late: the timeline has slid by {}",
                                millisecondsText(input.slipped - slipped_)));
    slipped_ = input.slipped;
  }
  if (const auto* asked = std::get_if<Requested>(&input.what)) {
    note(input.now,
         fmt::format("call {}: {}", asked->call, textOf(asked->request, AxisWords(axes_))));
  } else if (const auto* news = std::get_if<EngineNews>(&input.what)) {
    noteNews(input, *news);
  } else if (const auto* read = std::get_if<InputRead>(&input.what)) {
    note(input.now, read->level < 0
                        ? fmt::format("input {} can't be read: {}", names_.input(read->input),
                                      gpio::errorText(-read->level))
                        : fmt::format("input {} is {}", names_.input(read->input),
                                      read->level != 0 ? "high" : "low"));
  } else if (const auto* edge = std::get_if<InputEdge>(&input.what)) {
    note(input.now,
         fmt::format("input {} went {}, {} before this", names_.input(edge->edge.input),
                     edge->edge.level ? "high" : "low",
                     millisecondsText(std::max<std::int64_t>(0, input.now - edge->edge.time_ns))));
  } else if (const auto* done = std::get_if<activity::PinDone>(&input.what)) {
    const auto job = jobs_.find(done->id);
    if (job == jobs_.end()) return;
    if (done->error != 0) {
      note(input.now, fmt::format("{} can't be written: {}", names_.output(job->second),
                                  gpio::errorText(done->error)));
    }
    jobs_.erase(job);
  } else if (const auto* access = std::get_if<bus::RegisterDone>(&input.what)) {
    if (access->failure == bus::Failure::kNone) return;
    note(input.now, access->failure == bus::Failure::kPort
                        ? access->port_error
                        : fmt::format("register {:02X}h of a driver chip: {}",
                                      access->failed_number, bus::causeOf(access->failure)));
  }
}

void FlightRecorder::noteNews(const Input& input, const EngineNews& news) {
  news_.channels.resize(news.channels.size());
  if (news.stops_served != news_.stops_served) {
    note(input.now,
         news.input_stops != news_.input_stops ? "emergency stop, by its input" : "emergency stop");
  }
  for (std::size_t i = 0; i < news.channels.size(); ++i) {
    const pulse::ChannelState& before = news_.channels[i];
    const pulse::ChannelState& now = news.channels[i];
    if (now.taken != before.taken && now.accepted != now.taken) {
      note(input.now, fmt::format("{}: plan {} came too late or from another state; the pulse "
                                  "thread refused it",
                                  axes_[i].name, now.taken));
    }
    if (now.ended != before.ended) {
      note(now.end_time + input.slipped, fmt::format("{}: plan {} {} at count {}", axes_[i].name,
                                                     now.ended, textOf(now.end), now.count));
    }
  }
  news_ = news;
}

void FlightRecorder::addTurn(const Input& input, const activity::Outputs& out,
                             const MachineSnapshot& before, const MachineSnapshot& after) {
  noteFaults(input.now, before, after);
  for (const auto& [call, reply] : out.answers) {
    note(input.now, fmt::format("call {}: {}", call, outcomeText(reply)));
  }
  for (const pulse::Command& command : out.commands) notePlans(input, command, after);
  for (const activity::PinJob& job : out.pin_jobs) jobs_[job.id] = job.output;
}

void FlightRecorder::notePlans(const Input& input, const pulse::Command& command,
                               const MachineSnapshot& snapshot) {
  for (std::size_t i = 0; i < command.follow_count; ++i) {
    const pulse::Follow& follow = command.follows[i];
    const auto axis = static_cast<std::size_t>(follow.channel);
    const AxisSnapshot& seen = snapshot.axes.at(axis);
    const motion::ShapedProfile& profile = follow.profile;
    const double from = profile.stateAt(profile.startNs()).position.value();
    const double to = profile.endPosition().value();
    const auto place = [&](double count) {
      return config::placeText(seen.origin + count / seen.steps_per_unit, axes_[axis].kind,
                               seen.steps_per_unit);
    };
    const double start = static_cast<double>(profile.startNs() + input.slipped - input.now) * 1e-9;
    const double duration = static_cast<double>(profile.endNs() - profile.startNs()) * 1e-9;
    note(input.now,
         fmt::format("{}: plan {}{}: motor from count {:.0f} ({}) to {:.0f} ({}) in {:.6f} s, "
                     "beginning in {:.6f} s",
                     axes_[axis].name, follow.serial,
                     follow.continues != 0 ? fmt::format(", after {}", follow.continues) : "", from,
                     place(from), to, place(to), duration, start));
  }
}

void FlightRecorder::noteFaults(pulse::Nanoseconds now, const MachineSnapshot& before,
                                const MachineSnapshot& after) {
  bool new_fault = false;
  for (std::size_t i = 0; i < after.axes.size(); ++i) {
    const std::string& was = before.axes[i].state.fault;
    const std::string& is = after.axes[i].state.fault;
    if (was == is) continue;
    new_fault = new_fault || !is.empty();
    note(now, axes_[i].name + (is.empty() ? ": no fault anymore" : ": fault: " + is));
  }
  if (!new_fault) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  faulty_before_ = true;
  if (on_fault_) on_fault_();
}

void FlightRecorder::onFault(std::function<void()> told) {
  const std::lock_guard<std::mutex> lock(mutex_);
  on_fault_ = std::move(told);
  if (on_fault_ && faulty_before_) on_fault_();
}

// ---- what is read ----

Recording FlightRecorder::recording(pulse::Clock& clock) const {
  Recording recording;
  recording.pins = pins_;
  const pulse::PinRing::Copy steps = pulse_ring_.copy(clock);
  const pulse::PinRing::Copy others = other_ring_.copy(clock);
  readEvents(recording);
  recording.end = clock.now();
  recording.begin = std::max(started_, recording.end - length_);
  for (const pulse::PinRing::Copy* ring : {&steps, &others}) {
    // Other edges of the same time may be lost.
    if (!ring->overwritten || ring->edges.empty() || ring->edges.front().time < recording.begin) {
      continue;
    }
    recording.begin = ring->edges.front().time + 1;
    recording.shortened = true;
  }
  // Each output but those with a name is written by the writers of one ring: the levels of the
  // other are those of the beginning.
  recording.levels = others.levels;
  for (const Recording::Pin& pin : pins_) {
    const auto output = static_cast<std::size_t>(pin.output);
    const bool by_pulses =
        pin.name == "step" || pin.name == "dir" || pin.name == "cw" || pin.name == "ccw";
    if (by_pulses) recording.levels[output] = steps.levels[output];
  }
  addEdges(edgesOf(steps, others, recording.begin), recording);
  return recording;
}

void FlightRecorder::readEvents(Recording& recording) const {
  const EventRing::Copy events = events_.copy();
  recording.events_lost = events.overwritten;
  for (const EventRing::Record& record : events.records) {
    const auto* const text = reinterpret_cast<const char*>(&record[1]);
    const std::size_t most = kTextWords * sizeof(std::uint64_t);
    recording.events.push_back(
        {static_cast<pulse::Nanoseconds>(record[0]), std::string(text, strnlen(text, most))});
  }
  // The end of a motion is noted a moment later, with the time at which it was.
  std::stable_sort(recording.events.begin(), recording.events.end(),
                   [](const auto& a, const auto& b) { return a.time < b.time; });
}

}  // namespace stepdriver::machine
