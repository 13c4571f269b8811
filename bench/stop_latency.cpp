#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <fstream>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "support/bench.h"

// Measures how long a stop takes while two clients prepare long trajectories: from the call of the
// machine to its return, which is all that the node's handler does.

namespace stepdriver::bench {
namespace {

constexpr const char* kUsage =
    R"(usage: stop_latency [--calls N] [--seconds S] [--points N] [--json FILE]

Two threads prepare trajectories of three axes on the simulated rig, one after the other, and a third one
stops them: N times, or for S seconds if that is over first. Prints how long the calls took [ms], of
stop() and of emergencyStop(), which recover() follows.

  --calls N    of each kind; default: 1000
  --seconds S  for each kind; default: 60
  --points N   of each trajectory; default: 300000
  --json FILE  writes the figures there too
)";

using SteadyTime = std::chrono::steady_clock;

struct Options {
  int calls = 1000;
  double seconds = 60.0;
  int points = 300'000;
  std::string json;
};

struct Latency {
  std::vector<double> times;  // [ms]
  int prepared = 0;           // trajectories meanwhile, and those that were refused at their end

  double percentile(double part) const {
    std::vector<double> sorted = times;
    std::sort(sorted.begin(), sorted.end());
    const auto index = static_cast<std::size_t>(part * static_cast<double>(sorted.size()));
    return sorted.at(std::min(index, sorted.size() - 1));
  }
};

double secondsSince(SteadyTime::time_point begin) {
  return std::chrono::duration<double>(SteadyTime::now() - begin).count();
}

std::vector<config::AxisConfig> threeAxes() {
  std::vector<config::AxisConfig> axes;
  for (const char* name : {"x", "y", "z"}) {
    axes.push_back(test::linearAxis(name));
    axes.back().endstop_min.reset();
    axes.back().endstop_max.reset();
  }
  return axes;
}

constexpr double kPeriod = 0.01;  // [s] from point to point

/// [m] A slow wave that begins and ends at rest.
double waveAt(double time, double duration) {
  constexpr double kAmplitude = 0.01;  // [m]
  constexpr double kRate = 0.5;        // [rad/s]
  const double begun = std::clamp(time, 0.0, 1.0);
  const double left = std::clamp(duration - time, 0.0, 1.0);
  return kAmplitude * begun * begun * left * left * std::sin(kRate * time);
}

motion::TrajectoryRequest waveOf(int points) {
  motion::TrajectoryRequest request;
  request.names = {"x", "y", "z"};
  request.points.reserve(static_cast<std::size_t>(points));
  const double duration = kPeriod * points;
  for (int i = 1; i <= points; ++i) {
    motion::TrajectoryPoint point;
    point.time = kPeriod * i;
    const double speed =
        (waveAt(point.time + 1e-4, duration) - waveAt(point.time - 1e-4, duration)) / 2e-4;
    point.positions.assign(3, waveAt(point.time, duration));
    point.velocities.assign(3, i < points ? speed : 0.0);
    request.points.push_back(point);
  }
  return request;
}

class Preparing {
 public:
  Preparing(machine::Machine& machine, const motion::TrajectoryRequest& request) {
    for (std::thread& thread : threads_) {
      thread = std::thread([this, &machine, &request] {
        while (!ended_) {
          try {
            machine.followTrajectory(request);
          } catch (const std::exception& error) {
            // It was stopped, or the machine is at fault at the moment.
            std::this_thread::yield();
          }
          ++prepared_;
        }
      });
    }
  }
  ~Preparing() {
    ended_ = true;
    for (std::thread& thread : threads_) thread.join();
  }
  Preparing(const Preparing&) = delete;
  Preparing& operator=(const Preparing&) = delete;

  int prepared() const { return prepared_; }

 private:
  std::atomic<bool> ended_{false};
  std::atomic<int> prepared_{0};
  std::vector<std::thread> threads_{2};
};

/// @param call the measured call.
/// @param after is called after each measurement, and isn't measured.
Latency measure(const Options& options, const std::function<void(machine::Machine&)>& call,
                const std::function<void(machine::Machine&)>& after) {
  const auto axes = threeAxes();
  pulse::VirtualClock clock(1.0);
  sim::Rig rig(test::Bench::rigAxes(axes));
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  machine::Machine machine(axes, backend, clock, {});
  const motion::TrajectoryRequest request = waveOf(options.points);
  Latency latency;
  const Preparing preparing(machine, request);
  const auto begin = SteadyTime::now();
  for (int i = 0; i < options.calls && (i == 0 || secondsSince(begin) < options.seconds); ++i) {
    // At a random time of a preparation.
    std::this_thread::sleep_for(std::chrono::milliseconds(5 + i % 7));
    const auto called = SteadyTime::now();
    call(machine);
    latency.times.push_back(secondsSince(called) * 1e3);
    after(machine);
  }
  latency.prepared = preparing.prepared();
  return latency;
}

int run(const Options& options) {
  const Latency stop = measure(
      options, [](machine::Machine& machine) { machine.stop(); }, [](machine::Machine&) {});
  const Latency emergency = measure(
      options, [](machine::Machine& machine) { machine.emergencyStop(); },
      [](machine::Machine& machine) { machine.recover(); });
  std::string json;
  for (const auto& [name, latency] :
       {std::make_pair("stop", &stop), std::make_pair("emergency_stop", &emergency)}) {
    std::printf(
        "%-14s %5zu calls, %4d trajectories of %d points; ms: p50 %.3f, p99 %.3f, max %.3f\n", name,
        latency->times.size(), latency->prepared, options.points, latency->percentile(0.5),
        latency->percentile(0.99), latency->percentile(1.0));
    json += std::string(json.empty() ? "" : ", ") + "{\"name\": \"Preparing/" + name +
            "\", \"p99_ms\": " + std::to_string(latency->percentile(0.99)) +
            ", \"max_ms\": " + std::to_string(latency->percentile(1.0)) +
            ", \"calls\": " + std::to_string(latency->times.size()) + "}";
  }
  if (!options.json.empty()) std::ofstream(options.json) << "{\"benchmarks\": [" << json << "]}\n";
  return 0;
}

bool read(int argc, char** argv, Options& options) {
  for (int i = 1; i < argc; i += 2) {
    if (i + 1 == argc) return false;
    const std::string name = argv[i];
    const std::string value = argv[i + 1];
    if (name == "--calls") {
      options.calls = std::stoi(value);
    } else if (name == "--seconds") {
      options.seconds = std::stod(value);
    } else if (name == "--points") {
      options.points = std::stoi(value);
    } else if (name == "--json") {
      options.json = value;
    } else {
      return false;
    }
  }
  return options.calls > 0 && options.points > 100;
}

}  // namespace
}  // namespace stepdriver::bench

int main(int argc, char** argv) {
  namespace bench = stepdriver::bench;
  try {
    bench::Options options;
    if (!bench::read(argc, argv, options)) {
      std::fputs(bench::kUsage, stderr);
      return 2;
    }
    return bench::run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stop_latency: %s\n", error.what());
    return 1;
  }
}
