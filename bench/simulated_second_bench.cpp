#include <benchmark/benchmark.h>

#include <cstdint>
#include <string>
#include <vector>

#include "support/bench.h"

// The whole way of a move, from the request to the simulated carriage, on the virtual clock:
// measures how much faster than real time it runs.

namespace stepdriver::bench {
namespace {

constexpr double kStepsPerUnit = 16'000.0;
constexpr double kSpeed = 1.0;  // 16,000 steps/s

config::AxisConfig fastAxis(std::int64_t index) {
  config::AxisConfig config = test::linearAxis("a" + std::to_string(index));
  config.steps_per_unit = kStepsPerUnit;
  config.max_speed = kSpeed;
  config.acceleration = 10.0;
  config.deceleration = 10.0;
  config.endstop_min.reset();
  config.endstop_max.reset();
  return config;
}

/// Each axis moves forward and back; items are simulated seconds.
void simulatedSeconds(benchmark::State& state) {
  std::vector<config::AxisConfig> axes;
  for (std::int64_t i = 0; i < state.range(0); ++i) axes.push_back(fastAxis(i));
  pulse::VirtualClock clock;
  sim::Rig rig(test::Bench::judged(test::Bench::rigAxes(axes), axes));
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  test::UnthreadedMachine machine(axes, backend, clock);

  double target = 0.0;
  const pulse::Nanoseconds begin = clock.now();
  for (auto round : state) {
    target = 5.0 - target;
    std::vector<axis::Move> moves;
    for (const auto& axis : machine.axes()) moves.push_back(axis->moveTo(target));
    machine.advance(5.2);
    for (std::size_t i = 0; i < moves.size(); ++i) machine.axes()[i]->wait(moves[i]);
  }
  state.SetItemsProcessed((clock.now() - begin) / 1'000'000'000);
  for (const config::AxisConfig& config : axes) {
    const sim::RigAxisReport seen = rig.report(config.name);
    const auto steps = static_cast<std::int64_t>(target * kStepsPerUnit);
    if (seen.pulses_forward - seen.pulses_backward != steps) state.SkipWithError("missing pulses");
    if (seen.totalViolations() != 0) state.SkipWithError("the chip has seen wrong timings");
  }
}
BENCHMARK(simulatedSeconds)->Name("Simulated/axes")->Arg(1)->Arg(6);

}  // namespace
}  // namespace stepdriver::bench
