#include <benchmark/benchmark.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "point_to_point/planner.h"
#include "port/pin_ring.h"
#include "pulse/pulse_engine.h"
#include "support/free_hardware.h"

namespace stepdriver::bench {
namespace {

constexpr double kStepsPerSecond = 16'000.0;
constexpr std::int64_t kSteps = 40'000'000'000;  // more than any run makes
constexpr pulse::Nanoseconds kStart = 1'000'000;

/// How the steps of several axes coincide.
enum class Steps { kApart, kTogether };

pulse::ChannelConfig channelConfig(int channel) {
  pulse::ChannelConfig config;
  config.step.line = 2 * channel;
  config.dir.line = 2 * channel + 1;
  config.step_high = 1'900;
  config.step_low = 1'900;
  config.dir_setup = config.dir_hold = 650;
  return config;
}

/// The engine with free lines and a free clock, all axes in motion.
class EngineUnderLoad {
 public:
  EngineUnderLoad(int axes, Steps steps) {
    std::vector<pulse::ChannelConfig> channels;
    channels.reserve(static_cast<std::size_t>(axes));
    for (int i = 0; i < axes; ++i) channels.push_back(channelConfig(i));
    engine_ = std::make_unique<pulse::PulseEngine>(lines, clock_, channels, 1'000'000'000);
    for (int i = 0; i < axes; ++i) {
      // Speeds without a common measure: the edges of two axes hardly ever coincide.
      const double speed = kStepsPerSecond * (steps == Steps::kTogether ? 1.0 : 1.0 - 0.00731 * i);
      profiles_.push_back(std::make_unique<motion::Profile>(
          motion::planMove(kStart, {motion::fromInteger(0), 0.0, 0.0}, kSteps,
                           {100.0, speed, 100'000.0, 100'000.0})
              .profile));
      follows_.push_back({i, 1, profiles_.back().get()});
    }
    pulse::Command command;
    command.follows = follows_.data();
    command.follow_count = follows_.size();
    engine_->post(command);
    while (clock_.now() < 1'000'000'000) serve();  // until the ramps are over
  }

  /// Records all edges from now on, in 16 MB.
  void record() {
    const std::vector<bool> levels(2 * engine_->channels());
    ring_ = std::make_unique<pulse::PinRing>(levels, 2'000'000);
    engine_->recordTo(*ring_);
  }

  void serve() { clock_.waitUntil(engine_->serve()); }
  std::uint64_t slips() const { return engine_->state().slips; }

  FreeLines lines;

 private:
  FreeClock clock_;
  std::unique_ptr<pulse::PinRing> ring_;
  std::unique_ptr<pulse::PulseEngine> engine_;
  std::vector<std::unique_ptr<motion::Profile>> profiles_;
  std::vector<pulse::Follow> follows_;
};

void run(benchmark::State& state, Steps steps, bool recorded = false) {
  EngineUnderLoad load(static_cast<int>(state.range(0)), steps);
  if (recorded) load.record();
  const std::uint64_t before = load.lines.edges;
  for (auto unused : state) {
    (void)unused;
    load.serve();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(load.lines.edges - before));
  if (load.slips() != 0) state.SkipWithError("the timeline slid: this isn't the engine's own cost");
}

void edgesApart(benchmark::State& state) { run(state, Steps::kApart); }
void edgesTogether(benchmark::State& state) { run(state, Steps::kTogether); }
void edgesRecorded(benchmark::State& state) { run(state, Steps::kApart, true); }

/// The recorder alone: the edges of one STEP line.
void recordedEdge(benchmark::State& state) {
  pulse::PinRing ring({false, false}, 2'000'000);
  pulse::Nanoseconds now = 0;
  bool level = false;
  for (auto unused : state) {
    (void)unused;
    level = !level;
    now += 31'250;
    ring.add(0, level, now);
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations()));
}

BENCHMARK(edgesApart)->Name("Engine/edges_apart")->RangeMultiplier(2)->Range(1, 32);
BENCHMARK(edgesRecorded)->Name("Engine/edges_recorded")->Arg(1)->Arg(32);
BENCHMARK(recordedEdge)->Name("Recorder/edge");
BENCHMARK(edgesTogether)->Name("Engine/edges_together")->RangeMultiplier(2)->Range(2, 32);

}  // namespace
}  // namespace stepdriver::bench
