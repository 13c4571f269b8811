#include "support/paced_run.h"

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

#include "profile/profile.h"
#include "profile/step_finder.h"
#include "pulse/cpu_latency.h"
#include "pulse/pulse_engine.h"
#include "pulse/pulse_thread.h"
#include "pulse/realtime.h"
#include "sim/rotor_model.h"
#include "support/free_hardware.h"

namespace stepdriver::bench {
namespace {

using pulse::Nanoseconds;

constexpr int kMicrosteps = 16;                       // in a full step
constexpr double kRamp = 0.2;                         // what each ramp takes of a motion's time
constexpr Nanoseconds kStepTime = 1000;               // an A4988's, high and low
constexpr Nanoseconds kBegin = 20'000'000;            // from now
constexpr Nanoseconds kMaxLateness = 60'000'000'000;  // a late edge is a result here, not a fault

// A write of a STEP line: when, and what the timeline was slid by then.
struct Edge {
  Nanoseconds time;
  Nanoseconds slipped;
  bool level;
};

/// Remembers the edges of the STEP lines; takes only the time for reading the clock. STEP of axis i
/// is output 2 i, DIR the one after it.
class PacedLines : public FreeLines {
 public:
  PacedLines(int axes, std::size_t edges_of_each) : edges_of_(static_cast<std::size_t>(axes)) {
    for (auto& kept : edges_of_) kept.reserve(edges_of_each);
  }

  int write(const gpio::LineWrite* lines, std::size_t count) noexcept override {
    const Nanoseconds now = clock_.now();
    for (std::size_t i = 0; i < count; ++i) {
      if (lines[i].output % 2 != 0) continue;
      auto& kept = edges_of_[static_cast<std::size_t>(lines[i].output / 2)];
      // Never more than was reserved, because the pulse thread must not allocate memory.
      if (kept.size() < kept.capacity()) {
        kept.push_back({now, engine_->state().slipped, lines[i].level});
      }
    }
    return 0;
  }

  void serve(const pulse::PulseEngine& engine) { engine_ = &engine; }
  const std::vector<Edge>& edgesOf(std::size_t axis) const { return edges_of_[axis]; }

 private:
  pulse::SteadyClock clock_;
  const pulse::PulseEngine* engine_ = nullptr;
  std::vector<std::vector<Edge>> edges_of_;
};

std::vector<pulse::ChannelConfig> channelsOf(const PacedRun& run) {
  std::vector<pulse::ChannelConfig> channels(static_cast<std::size_t>(run.axes));
  for (int i = 0; i < run.axes; ++i) {
    pulse::ChannelConfig& channel = channels[static_cast<std::size_t>(i)];
    channel.step = {2 * i, true};
    channel.dir = {2 * i + 1, true};
    channel.step_high = kStepTime;
    channel.step_low = kStepTime;
    channel.late_steps = run.late_steps;
  }
  return channels;
}

double processSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) * 1e-9;
}

struct Plan {
  Nanoseconds begin = 0;
  std::vector<std::unique_ptr<const motion::Profile>> profiles;
};

// A ramp up to the rate, a constant speed, and a ramp down, over a whole number of steps.
motion::Profile trapezoid(Nanoseconds begin, double rate, double seconds) {
  const double ramp = kRamp * seconds;
  const double steps = std::floor(rate * (seconds - ramp));
  const motion::Piece up{ramp, 0.0, 0.0, rate / ramp, 0.0};
  const motion::Piece cruise{steps / rate - ramp, up.positionAt(ramp), rate, 0.0, 0.0};
  const motion::Piece down{ramp, cruise.positionAt(cruise.duration), rate, -rate / ramp, 0.0};
  return {begin, std::vector<motion::Piece>{up, cruise, down}};
}

Plan planned(Nanoseconds begin, const PacedRun& run) {
  Plan plan{begin, {}};
  for (int i = 0; i < run.axes; ++i) {
    plan.profiles.push_back(std::make_unique<motion::Profile>(
        trapezoid(begin, run.rate * (1.0 - 0.01 * i), run.seconds)));
  }
  return plan;
}

// If the machine stalls so long that the order reaches the engine too late, the order is made
// again.
Plan start(pulse::PulseEngine& engine, pulse::Clock& clock, const PacedRun& run) {
  Nanoseconds ahead = kBegin;
  for (std::uint64_t serial = 1;; ++serial, ahead *= 2) {
    Plan plan = planned(clock.now() - engine.state().slipped + ahead, run);
    std::vector<pulse::Follow> follows(plan.profiles.size());
    for (std::size_t i = 0; i < follows.size(); ++i) {
      follows[i].channel = static_cast<int>(i);
      follows[i].serial = serial;
      follows[i].profile = plan.profiles[i].get();
      follows[i].full_step = kMicrosteps;
    }
    pulse::Command command;
    command.follows = follows.data();
    command.follow_count = follows.size();
    while (!engine.post(command)) std::this_thread::yield();
    // The channel of an order that is reported last.
    while (engine.channel(0).taken != serial) {
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
    if (engine.channel(0).accepted == serial) return plan;
  }
}

// For one axis: compares each edge with the plan, and with the other edge of its pulse.
void take(PacedFigures& figures, const std::vector<Edge>& edges, const motion::Profile& profile) {
  motion::StepFinder finder(profile, 0);
  motion::Step step;
  const Edge* rose = nullptr;
  const Edge* fell = nullptr;
  for (const Edge& edge : edges) {
    const Edge* const before = edge.level ? fell : rose;
    if (before != nullptr && edge.time - before->time < kStepTime) ++figures.too_short;
    if (!edge.level) {
      fell = &edge;
      continue;
    }
    if (!finder.next(step)) throw std::logic_error("more steps went out than were planned");
    ++figures.edges;
    figures.lateness.push_back(edge.time - (step.time_ns + edge.slipped));
    if (figures.lateness.back() < 0) ++figures.early;
    if (rose != nullptr) figures.shortest = std::min(figures.shortest, edge.time - rose->time);
    rose = &edge;
  }
  if (finder.next(step)) throw std::logic_error("fewer steps went out than were planned");
}

// A common NEMA 17 motor, damped as little as a motor is, with a heavy load.
sim::MotorSpec loadedMotor() {
  sim::MotorSpec motor;
  motor.friction = 0.4 * motor.holding_torque;
  motor.damping = 0.05;
  return motor;
}

// For one axis: what its motor makes of the edges.
void turnRotor(PacedFigures& figures, const std::vector<Edge>& edges) {
  constexpr double kMicrostep = 0.5 * sim::kPi / kMicrosteps;  // [electrical rad]
  constexpr Nanoseconds kAfterwards = 1'000'000'000;
  sim::RotorModel rotor(loadedMotor());
  rotor.rest(edges.front().time);
  for (const Edge& edge : edges) {
    if (!edge.level) continue;
    rotor.turnTo(edge.time);
    rotor.moveField(kMicrostep);
  }
  rotor.turnTo(edges.back().time + kAfterwards);
  figures.largest_lag = std::max(figures.largest_lag, rotor.largestLag() * 180.0 / sim::kPi);
  figures.lost += 4 * rotor.slips();
}

}  // namespace

Nanoseconds PacedFigures::percentile(double part) const {
  if (lateness.empty()) return 0;
  const auto last = static_cast<double>(lateness.size() - 1);
  return lateness[static_cast<std::size_t>(std::lround(part * last))];
}

PacedFigures runPaced(const PacedRun& run) {
  pulse::SteadyClock clock;
  const auto steps = static_cast<std::size_t>(std::ceil(run.rate * run.seconds));
  PacedLines lines(run.axes, 2 * steps + 2);
  pulse::PulseEngine engine(lines, clock, channelsOf(run), kMaxLateness);
  lines.serve(engine);
  pulse::PulseThread thread(engine, clock);

  const Plan plan = start(engine, clock, run);
  const double used = processSeconds();
  for (int i = 0; i < run.axes; ++i) {
    while (engine.channel(i).following != 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
  const double elapsed = static_cast<double>(clock.now() - plan.begin) * 1e-9;

  PacedFigures figures;
  figures.cpu = (processSeconds() - used) / elapsed;
  figures.scheduler_error = thread.rights().scheduler_error;
  thread.stop();
  for (int i = 0; i < run.axes; ++i) {
    const auto& edges = lines.edgesOf(static_cast<std::size_t>(i));
    take(figures, edges, *plan.profiles[static_cast<std::size_t>(i)]);
    turnRotor(figures, edges);
  }
  figures.slips = engine.state().slips;
  figures.slipped = engine.state().slipped;
  std::sort(figures.lateness.begin(), figures.lateness.end());
  return figures;
}

PacedFigures runNanosleep(double rate, double seconds) {
  PacedFigures figures;
  const auto count = static_cast<std::size_t>(rate * seconds);
  figures.lateness.reserve(count);
  pulse::SteadyClock clock;
  const double used = processSeconds();
  std::thread([&] {
    figures.scheduler_error = pulse::askForScheduler(pulse::kRealtimePriority);
    const pulse::CpuLatencyHold awake;
    const Nanoseconds begin = clock.now() + kBegin;
    Nanoseconds last = begin;
    for (std::size_t i = 0; i < count; ++i) {
      const Nanoseconds due = begin + std::llround(static_cast<double>(i) * 1e9 / rate);
      timespec deadline{};
      deadline.tv_sec = static_cast<time_t>(due / 1'000'000'000);
      deadline.tv_nsec = static_cast<decltype(deadline.tv_nsec)>(due % 1'000'000'000);
      while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) != 0) {
      }
      const Nanoseconds now = clock.now();
      figures.lateness.push_back(now - due);
      if (i > 0) figures.shortest = std::min(figures.shortest, now - last);
      last = now;
    }
  }).join();
  figures.cpu = (processSeconds() - used) / seconds;
  figures.edges = count;
  std::sort(figures.lateness.begin(), figures.lateness.end());
  return figures;
}

Load::Load() {
  for (unsigned i = 0; i < std::max(1U, std::thread::hardware_concurrency()); ++i) {
    const pid_t process = fork();
    if (process < 0) throw std::runtime_error("no process could be made to load the machine with");
    if (process == 0) {
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      for (volatile std::uint64_t busy = 0;; busy = busy + 1) {
      }
    }
    processes_.push_back(process);
  }
}

Load::~Load() {
  for (const int process : processes_) {
    kill(process, SIGKILL);
    waitpid(process, nullptr, 0);
  }
}

}  // namespace stepdriver::bench
