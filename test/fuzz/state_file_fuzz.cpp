#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fuzz/fuzz_input.h"
#include "machine/state_file.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"

// The input is a state file. Whatever it says, the machine starts, believes only what is within the
// limits of its axes, and moves nothing by itself.

namespace stepdriver::fuzz {
namespace {

std::vector<config::AxisConfig> axes() {
  config::AxisConfig x = test::linearAxis("x", 1000.0, 0.1, 1.0);
  x.min_position = -0.05;
  x.max_position = 0.1;
  x.backlash = 0.004;
  x.holds_position_unpowered = true;
  config::AxisConfig turntable = test::linearAxis("turntable", 200.0, 1.0, 10.0);
  turntable.kind = config::Kind::kRotary;
  for (config::AxisConfig* axis : {&x, &turntable}) {
    axis->endstop_min.reset();
    axis->endstop_max.reset();
  }
  return {x, turntable};
}

/// What load() says, or nothing if it refuses.
std::optional<machine::KeptState> loaded(const machine::StateFile& file) {
  try {
    return file.load();
  } catch (const Error& error) {
    require(std::string(error.what()).find(file.path()) != std::string::npos,
            fmt::format("a refusal names the file: {}", error.what()));
    return std::nullopt;
  }
}

/// What was read can be written, and read again.
std::optional<machine::KeptState> readAndWritten(const std::string& path) {
  const machine::StateFile file(path);
  std::optional<machine::KeptState> kept = loaded(file);
  if (!kept) return kept;
  for (const auto& [name, axis] : kept->axes) {
    require(std::isfinite(axis.position) && std::isfinite(axis.slack) && axis.steps_per_unit > 0.0,
            "the numbers of axis " + name + " are finite, and its scale is above 0");
  }
  file.save(*kept);
  const std::optional<machine::KeptState> again = loaded(file);
  require(again && again->clean == kept->clean && again->axes == kept->axes,
          "a state that was saved is read again as the same state");
  return kept;
}

void checkRestored(const config::AxisConfig& config, const axis::AxisState& state,
                   const std::optional<machine::KeptState>& kept) {
  const double step = 1.0 / config.steps_per_unit;
  require(std::isfinite(state.position), config.name + " has a finite position");
  require(!config.min_position || state.position >= *config.min_position - step,
          fmt::format("{} m isn't below the limit of {}", state.position, config.name));
  require(!config.max_position || state.position <= *config.max_position + step,
          fmt::format("{} m isn't above the limit of {}", state.position, config.name));
  require(state.slack >= 0.0 && state.slack <= config.backlash + step,
          fmt::format("the slack {} m of {} is within its backlash", state.slack, config.name));
  require(state.position_valid || !state.position_note.empty(),
          config.name + " says why its position can't be trusted");
  if (!state.position_valid) return;
  require(kept && kept->clean && kept->axes.count(config.name) != 0,
          "only a clean state makes a position valid");
  const axis::AxisMemory& memory = kept->axes.at(config.name);
  require(memory.valid && std::abs(memory.position - state.position) <= step,
          config.name + " stands where the state says");
}

/// A machine that starts with the file, and comes back to 0.
void start(const std::string& path, const std::optional<machine::KeptState>& kept) {
  const std::vector<config::AxisConfig> configs = axes();
  machine::MachineOptions options;
  options.state_file = path;
  test::Bench bench(configs, test::Bench::rigAxes(configs), false, 0.0, options);
  bench.machine->advance(0.001);
  for (const config::AxisConfig& config : configs) {
    require(bench.pulses(config.name) == 0, config.name + " doesn't move by itself");
    checkRestored(config, bench.axis(config.name).state(), kept);
  }
  require(bench.move(0.0, "x").end == axis::MoveEnd::kReached,
          "x can move from any position that it believes");
  require(std::abs(bench.axis("x").state().position) <= 0.5 / configs[0].steps_per_unit + 1e-12,
          "x has reached 0");
}

}  // namespace
}  // namespace stepdriver::fuzz

// NOLINTNEXTLINE(readability-identifier-naming): the name that libFuzzer calls
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stepdriver::fuzz;
  static const std::string path = ownFolder() + "/state";
  writeFile(path, data, size);
  const auto kept = readAndWritten(path);
  writeFile(path, data, size);
  start(path, kept);
  return 0;
}
