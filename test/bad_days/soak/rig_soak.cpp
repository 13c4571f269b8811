// Random commands to three axes on the simulated rig, for a time or for a number of edges.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "commands.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "watch.h"

namespace stepdriver::soak {
namespace {

constexpr const char* kUsage = R"(usage: rig_soak [--minutes M] [--edges N] [--clients K] [--seed S]

Sends random commands of every kind to three axes on the simulated rig, which runs as fast as it can,
until M minutes have passed or N edges of STEP have gone out. K clients send at the same time (default:
4); with 0 the program is one thread, and the same seed gives the same edges. Now and then all axes come
to rest; then each position must be the count of the pulses that the rig has seen. Prints a line each
minute, and a summary. Exit code 0: no violation, no mismatch, no error, and memory and descriptors are
flat.
)";

constexpr double kScale = 400'000.0;  // [steps/m]
constexpr double kSpeed = 0.25;       // [m/s]

struct Options {
  double minutes = 1e9;
  double edges = 1e18;
  int clients = 4;
  unsigned seed = 1;
};

const std::vector<std::string> kNames{"x", "y", "z"};

config::AxisConfig axisOf(const std::string& name, double jerk) {
  config::AxisConfig config = test::linearAxis(name, kScale, kSpeed, 5.0);
  config.jerk = jerk;
  config.min_position = -kReach;
  config.max_position = kReach;
  config.holds_position_unpowered = true;
  return config;
}

class RigSoak {
 public:
  explicit RigSoak(const Options& options)
      : options_(options),
        axes_{axisOf("x", 0.0), axisOf("y", 200.0), axisOf("z", 0.0)},
        rig_(test::Bench::rigAxes(axes_)),
        backend_(rig_, [this] { return clock_.now(); }) {
    machine::MachineOptions machine_options;
    machine_ = std::make_unique<test::UnthreadedMachine>(axes_, backend_, clock_, machine_options,
                                                         options.clients > 0);
    for (int i = 0; i < std::max(1, options.clients); ++i) {
      commands_.emplace_back(*machine_, kNames, options.seed * 1000 + static_cast<unsigned>(i));
    }
  }

  int run() {
    if (options_.clients == 0) {
      runAlone();
    } else {
      runTogether();
    }
    Counts all;
    for (const RandomCommands& client : commands_) {
      for (const auto& [kind, count] : client.counts()) {
        all[kind].accepted += count.accepted;
        all[kind].refused += count.refused;
      }
    }
    return watch_.conclude(findings_, all);
  }

 private:
  static constexpr int kBetweenChecks = 40;  // commands of one client

  bool isOver() const {
    return watch_.seconds() > 60.0 * options_.minutes ||
           static_cast<double>(findings_.edges) >= options_.edges;
  }

  void complain(const std::string& text) {
    ++findings_.errors;
    std::fprintf(stderr, "%s\n", text.c_str());
  }

  void runAlone() {
    RandomCommands& client = commands_.front();
    while (!isOver()) {
      for (int i = 0; i < kBetweenChecks; ++i) {
        client.send();
        machine_->advance(client.random().within(0.0, 0.3));
      }
      restAndCheck();
    }
  }

  // Each client sends some commands; then all wait while the positions are checked.
  void runTogether() {
    while (!isOver()) {
      std::vector<std::thread> clients;
      for (RandomCommands& client : commands_) {
        clients.emplace_back([this, &client] {
          try {
            for (int i = 0; i < kBetweenChecks; ++i) {
              client.send();
              std::this_thread::sleep_for(
                  std::chrono::microseconds(client.random().whole(0, 3000)));
            }
            // A line of another client may wait for the end of a hold.
            machine_->resume();
          } catch (const Refused&) {
            // An emergency stop of another client came in the middle of the resume.
          } catch (const std::exception& error) {
            const std::lock_guard<std::mutex> lock(mutex_);
            complain(std::string("a call ended with: ") + error.what());
          }
        });
      }
      for (std::thread& client : clients) client.join();
      restAndCheck();
    }
  }

  void restAndCheck() {
    machine_->stop();
    for (int i = 0; i < 10'000 && moves(); ++i) pass();
    if (moves()) complain("an axis moves although all were stopped");
    // What was latched ends here, so that the next commands find a machine that works.
    machine_->recover();
    machine_->setSpeedOverride(1.0);
    findings_.violations = 0;
    for (const std::string& name : kNames) {
      const sim::RigAxisReport seen = rig_.report(name);
      findings_.violations += seen.totalViolations();
      const std::int64_t pulses = seen.pulses_forward - seen.pulses_backward;
      const axis::AxisState state = machine_->axis(name).state();
      if (std::llround(state.position * kScale) != pulses) {
        ++findings_.mismatches;
        std::fprintf(stderr, "%s: the position is %.9f m, but %lld pulses have gone out\n",
                     name.c_str(), state.position, static_cast<long long>(pulses));
      }
      if (!state.enabled) machine_->axis(name).enable(true);
    }
    findings_.edges = machine_->figures().edges;
    watch_.look(findings_);
  }

  bool moves() const {
    for (const std::string& name : kNames) {
      if (machine_->axis(name).state().moving) return true;
    }
    return false;
  }
  void pass() {
    if (options_.clients == 0) {
      machine_->advance(0.01);
    } else {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  const Options options_;
  pulse::VirtualClock clock_{0.0};
  const std::vector<config::AxisConfig> axes_;
  sim::Rig rig_;
  gpio::SimulatedBackend backend_;
  std::unique_ptr<test::UnthreadedMachine> machine_;
  std::vector<RandomCommands> commands_;
  std::mutex mutex_;
  Findings findings_;
  Watch watch_{6.0};
};

/// @return false if the words aren't understood.
bool read(int argc, char** argv, Options& options) {
  for (int i = 1; i < argc; i += 2) {
    if (i + 1 == argc) return false;
    char* end = nullptr;
    const double value = std::strtod(argv[i + 1], &end);
    if (*end != '\0' || !(value >= 0.0)) return false;
    const std::string name = argv[i];
    if (name == "--minutes") {
      options.minutes = value;
    } else if (name == "--edges") {
      options.edges = value;
    } else if (name == "--clients" && value <= 64.0) {
      options.clients = static_cast<int>(value);
    } else if (name == "--seed" && value <= 1e6) {
      options.seed = static_cast<unsigned>(value);
    } else {
      return false;
    }
  }
  return options.minutes < 1e9 || options.edges < 1e18;
}

}  // namespace
}  // namespace stepdriver::soak

int main(int argc, char** argv) {
  stepdriver::soak::Options options;
  if (!stepdriver::soak::read(argc, argv, options)) {
    std::fputs(stepdriver::soak::kUsage, stderr);
    return 64;
  }
  try {
    return stepdriver::soak::RigSoak(options).run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "FAILED: %s\n", error.what());
    return 1;
  }
}
