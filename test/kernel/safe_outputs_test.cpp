#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "machine_waveform.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "stepdriver_core/pulse/clock.h"

// Tests what the kernel sees of the outputs that something else depends on: steps on both edges,
// the brake and ENABLE, and the heartbeat of a process that is stopped or killed.

namespace stepdriver::kernel {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;

class SafeOutputs : public MachineWaveform {};

TEST_F(SafeOutputs, StepsOnBothEdgesHalveTheWrites) {
  std::array<std::size_t, 2> edges{};
  for (const bool both : {false, true}) {
    config::AxisConfig config = axisAt("x", "drv8825", placeAt("board-0", 0));
    config.driver.both_edges = both;
    KernelBench bench({config});
    EXPECT_EQ(bench.axis("x").wait(bench.start("x", 1000)).end, axis::MoveEnd::kReached);
    EXPECT_EQ(bench.count("x"), 1000);
    const KernelTrace seen = bench.finish(both ? "BothEdges" : "OneEdge");
    edges.at(both ? 1 : 0) = seen.edges(seen.line("board-0:0")).size();
  }
  EXPECT_EQ(edges[0], 2000U);
  EXPECT_EQ(edges[1], 1000U);
}

/// The level that an output was requested with, as an edge at time 0, and its edges.
std::vector<LineEdge> edgesFromRequest(const KernelTrace& trace, const std::string& name) {
  const unsigned line = trace.line(name);
  std::vector<LineEdge> edges = trace.edges(line);
  edges.insert(edges.begin(), {0, trace.firstLevel(line).value()});
  return edges;
}

/// Since when the output has had this level; -1 if it has another one at that time.
std::int64_t since(const std::vector<LineEdge>& edges, bool level, std::int64_t time_ns) {
  const auto after = std::find_if(edges.begin(), edges.end(),
                                  [&](const LineEdge& edge) { return edge.time_ns >= time_ns; });
  const LineEdge& last = *(after - 1);
  return last.level == level ? last.time_ns : -1;
}

TEST_F(SafeOutputs, TheBrakeHoldsWhileThereIsNoCurrent) {
  constexpr std::int64_t kRelease = 30 * kMillisecond;
  constexpr std::int64_t kEngage = 20 * kMillisecond;
  config::AxisConfig config = axisAt("z", "a4988", placeAt("board-0", 0));
  config.brake = config::BrakeConfig{"board-0:3", true, kRelease, kEngage};
  KernelBench bench({config});
  axis::Axis& z = bench.axis("z");
  z.wait(bench.start("z", 50));
  z.enable(false);
  z.enable(true);
  const axis::Move move = bench.start("z", 5000);
  bench.awaitCount("z", 150);
  bench.emergencyStop();
  z.wait(move);
  bench.recover();
  z.enable(false);
  z.enable(true);
  z.wait(bench.start("z", -50));
  const KernelTrace seen = bench.finish("Brake");

  const bool on = config.driver.enable_on;
  const std::vector<LineEdge> enable = edgesFromRequest(seen, config.pins.enable.line);
  const std::vector<LineEdge> brake = edgesFromRequest(seen, "board-0:3");
  ASSERT_FALSE(brake.front().level) << "it is engaged at first";
  std::size_t releases = 0;
  for (std::size_t i = 1; i < brake.size(); ++i) {
    if (!brake[i].level) continue;
    ++releases;
    EXPECT_GT(since(enable, on, brake[i].time_ns), 0) << "released without current";
  }
  EXPECT_EQ(releases, 4U) << "at the start, twice enabled, and after the emergency stop";
  std::size_t losses = 0;
  for (std::size_t i = 1; i < enable.size(); ++i) {
    if (enable[i].level == on) continue;
    ++losses;
    const std::int64_t engaged = since(brake, false, enable[i].time_ns);
    ASSERT_GT(engaged, 0) << "current gone while the brake is released";
    EXPECT_GE(enable[i].time_ns - engaged, kEngage);
  }
  EXPECT_EQ(losses, 3U) << "twice disabled, and shut down";
  for (const std::int64_t step : seen.times(seen.line(config.pins.step.line), true)) {
    const std::int64_t released = since(brake, true, step);
    ASSERT_GT(released, 0) << "a step against the brake";
    EXPECT_GE(step - released, kRelease);
  }
}

TEST_F(SafeOutputs, TheMotorPowerComesFirstAndGoesLast) {
  constexpr std::int64_t kOn = 40 * kMillisecond;
  constexpr std::int64_t kRelease = 30 * kMillisecond;
  constexpr std::int64_t kEngage = 20 * kMillisecond;
  config::AxisConfig config = axisAt("z", "a4988", placeAt("board-0", 0));
  config.brake = config::BrakeConfig{"board-0:3", true, kRelease, kEngage};
  machine::MachineOptions options;
  options.emergency_disable = machine::EmergencyDisable::kRamp;
  options.motor_power = config::MotorPowerConfig{};
  options.motor_power->line = "board-0:4";
  options.motor_power->on_ns = kOn;
  KernelBench bench({config}, options);
  axis::Axis& z = bench.axis("z");
  const axis::Move move = bench.start("z", 5000);
  bench.awaitCount("z", 300);
  bench.emergencyStop();
  z.wait(move);
  ASSERT_TRUE(bench.awaitLevel(0, 4, false));
  bench.recover();
  z.enable(true);
  z.wait(bench.start("z", -50));
  const KernelTrace seen = bench.finish("MotorPower");

  const bool on = config.driver.enable_on;
  const std::vector<LineEdge> enable = edgesFromRequest(seen, config.pins.enable.line);
  const std::vector<LineEdge> brake = edgesFromRequest(seen, "board-0:3");
  const std::vector<LineEdge> power = edgesFromRequest(seen, "board-0:4");
  ASSERT_EQ(power.size(), 5U) << "on at the start, off after the stop, on again, off at the end";
  EXPECT_FALSE(power.front().level);
  for (std::size_t i = 1; i < power.size(); ++i) {
    EXPECT_GT(since(enable, !on, power[i].time_ns), -1) << "the motor is enabled";
    const std::int64_t engaged = since(brake, false, power[i].time_ns);
    ASSERT_GT(engaged, -1) << "the brake is released";
    EXPECT_TRUE(power[i].level || power[i].time_ns - engaged >= kEngage);
  }
  for (std::size_t i = 1; i < enable.size(); ++i) {
    const std::int64_t there = since(power, true, enable[i].time_ns);
    ASSERT_GT(there, 0) << "ENABLE changes without power";
    EXPECT_TRUE(enable[i].level != on || enable[i].time_ns - there >= kOn);
  }
  for (const std::int64_t step : seen.times(seen.line(config.pins.step.line), true)) {
    EXPECT_GT(since(power, true, step), 0) << "a step without power";
    EXPECT_GT(since(brake, true, step), 0) << "a step against the brake";
  }
}

/// A machine with a heartbeat in a process of its own, whose axis moves back and forth.
class BeatingProcess {
 public:
  BeatingProcess() {
    std::array<int, 2> ready{};
    if (pipe(ready.data()) != 0) throw std::runtime_error("no pipe");
    child_ = fork();
    if (child_ == 0) {
      moveForEver(ready[1]);
      _exit(1);
    }
    close(ready[1]);
    char byte = 0;
    ready_ = read(ready[0], &byte, 1) == 1;
    close(ready[0]);
  }
  BeatingProcess(const BeatingProcess&) = delete;
  BeatingProcess& operator=(const BeatingProcess&) = delete;
  ~BeatingProcess() { end(); }

  bool ready() const { return ready_; }

  /// @return a time at which each of its threads has stopped. On the one processor of this kernel
  ///   the pulse thread may run for long after the signal.
  std::int64_t stop() const {
    kill(child_, SIGSTOP);
    waitpid(child_, nullptr, WUNTRACED);
    return pulse::SteadyClock().now();
  }

  void goOn() const { kill(child_, SIGCONT); }

  /// @return a time at which it has ended.
  std::int64_t end() {
    if (child_ > 0) {
      kill(child_, SIGKILL);
      waitpid(child_, nullptr, 0);
      child_ = -1;
    }
    return pulse::SteadyClock().now();
  }

 private:
  static void moveForEver(int ready) {
    try {
      const auto backend = gpio::makeLibgpiodBackend();
      pulse::SteadyClock clock;
      machine::MachineOptions options;
      options.max_lateness = 60.0;
      options.heartbeat = machine::HeartbeatConfig{"board-0:4"};
      machine::Machine machine({axisAt("x", "a4988", placeAt("board-0", 0))}, *backend, clock,
                               options);
      if (write(ready, "r", 1) != 1) return;
      axis::Axis& x = machine.axis("x");
      for (double way = 0.005;; way = -way) x.wait(x.moveTo(way, true));
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s\n", error.what());
    }
  }

  pid_t child_ = -1;
  bool ready_ = false;
};

TEST_F(SafeOutputs, TheHeartbeatEndsWithTheProcessThatIsStoppedOrKilled) {
  const auto pause = [] { std::this_thread::sleep_for(std::chrono::milliseconds(400)); };
  const std::array<test::GpioSimChip, 1> chips{{{"bench0", "board-0", 8}}};
  Recording recording;
  std::int64_t stopped = 0;
  std::int64_t went_on = 0;
  std::int64_t killed = 0;
  {
    BeatingProcess process;
    ASSERT_TRUE(process.ready());
    pause();
    stopped = process.stop();
    pause();
    went_on = pulse::SteadyClock().now();
    process.goOn();
    pause();
    killed = process.end();
  }
  pause();
  const KernelTrace seen = recording.stop("Heartbeat");
  const std::vector<LineEdge> beats = seen.edges(seen.line("board-0:4"));
  const auto between = [&](std::int64_t from, std::int64_t to) {
    return std::count_if(beats.begin(), beats.end(), [&](const LineEdge& beat) {
      return beat.time_ns > from && beat.time_ns <= to;
    });
  };
  EXPECT_GT(between(stopped - 200 * kMillisecond, stopped), 0);
  EXPECT_EQ(between(stopped, went_on), 0);
  EXPECT_GT(between(went_on, killed), 2);
  EXPECT_GT(between(killed - 200 * kMillisecond, killed), 0);
  EXPECT_EQ(between(killed, killed + 1000 * kMillisecond), 0);
}

}  // namespace
}  // namespace stepdriver::kernel
