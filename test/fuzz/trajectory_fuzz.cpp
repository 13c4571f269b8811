#include <fmt/format.h>
#include <fuzzer/FuzzedDataProvider.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "fuzz/fuzz_input.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"

// The input is the kind of two axes, and the points of a trajectory for one or both. It is refused
// with a message, and nothing moves; or the axes follow it within their limits, and come to rest
// at its last point.

namespace stepdriver::fuzz {
namespace {

using config::AxisConfig;

constexpr double kScale = 1000.0;  // [steps/m]
constexpr double kLongest = 4.0;   // [s] after this the trajectory is stopped
constexpr int kSamples = 60;

std::vector<AxisConfig> readAxes(FuzzedDataProvider& input) {
  std::vector<AxisConfig> configs{test::linearAxis("x", kScale, 0.5, 4.0),
                                  test::linearAxis("y", kScale, 0.2, 2.0)};
  for (AxisConfig& config : configs) {
    config.endstop_min.reset();
    config.endstop_max.reset();
    config.min_position = -1.0;
    config.max_position = 1.0;
    const auto kind = input.ConsumeIntegral<std::uint8_t>();
    if ((kind & 1U) != 0) config.backlash = 0.005;
    if ((kind & 2U) != 0) config.jerk = 40.0;
    if ((kind & 4U) != 0) config.start_speed = 0.02;
    if ((kind & 8U) != 0) config.stop_deceleration = 2.0 * config.deceleration;
  }
  return configs;
}

/// Mostly a number that a trajectory could have, ordinary or in one of twelve decades.
double readNumber(FuzzedDataProvider& input, double size) {
  const auto kind = input.ConsumeIntegral<std::uint8_t>();
  if (kind >= 250) return input.ConsumeFloatingPoint<double>();
  const double number = size * input.ConsumeIntegral<std::int16_t>() / 32768.0;
  if (kind < 160) return number;
  return number * std::pow(10.0, -12.0 * input.ConsumeIntegral<std::uint8_t>() / 255.0);
}

std::vector<double> readNumbers(FuzzedDataProvider& input, std::size_t axes, double size) {
  std::vector<double> numbers;
  const std::size_t count = input.ConsumeIntegral<std::uint8_t>() == 0 ? axes + 1 : axes;
  for (std::size_t i = 0; i < count; ++i) numbers.push_back(readNumber(input, size));
  return numbers;
}

motion::TrajectoryRequest readRequest(FuzzedDataProvider& input) {
  motion::TrajectoryRequest request;
  request.names = {"x", "y"};
  const auto shape = input.ConsumeIntegral<std::uint8_t>();
  if (shape % 4 == 1) request.names = {"y"};
  const bool velocities = (shape & 4U) != 0;
  const bool accelerations = (shape & 8U) != 0;
  double time = 0.0;
  while (input.remaining_bytes() > 0 && request.points.size() < 64) {
    motion::TrajectoryPoint point;
    time += std::abs(readNumber(input, 2.0));
    point.time = time;
    point.positions = readNumbers(input, request.names.size(), 0.3);
    if (velocities) point.velocities = readNumbers(input, request.names.size(), 0.5);
    if (accelerations) point.accelerations = readNumbers(input, request.names.size(), 4.0);
    request.points.push_back(point);
  }
  return request;
}

class Follower {
 public:
  explicit Follower(const std::vector<AxisConfig>& configs) : configs_(configs), bench_(configs) {}

  void follow(const motion::TrajectoryRequest& request) {
    machine::CoordinatedMove move;
    try {
      move = bench_.machine->followTrajectory(request);
    } catch (const Refused& refused) {
      requireMessage(refused.what());
      return checkNothingMoves();
    }
    require(std::isfinite(move.duration) && move.duration >= 0.0, "it takes a time");
    require(move.members.size() == request.names.size(), "each axis has its move");
    const double watched = std::min(move.duration, kLongest);
    for (int i = 0; i < kSamples; ++i) {
      bench_.machine->advance(watched / kSamples);
      check();
    }
    if (move.duration <= kLongest) {
      checkEnd(request, move);
    } else {
      stop();
    }
    for (const AxisConfig& config : configs_) {
      require(test::violationsOf(bench_.report(config.name)).empty(),
              config.name + " keeps the times of its chip");
    }
  }

 private:
  void checkNothingMoves() {
    bench_.machine->advance(0.05);
    for (const AxisConfig& config : configs_) {
      require(bench_.pulses(config.name) == 0 && !bench_.axis(config.name).state().moving,
              "a refused trajectory doesn't move " + config.name);
    }
  }

  void check() {
    for (const AxisConfig& config : configs_) check(config, bench_.axis(config.name).state());
  }

  /// Each state is within the limits, as motion::kTrajectoryTolerance allows.
  void check(const AxisConfig& config, const axis::AxisState& state) {
    const double step = 1.0 / config.steps_per_unit;
    const double tolerance = 1.0 + 2.0 * motion::kTrajectoryTolerance;
    require(std::abs(state.velocity) <= config.max_speed * tolerance + step,
            fmt::format("{} moves at {} of {} m/s", config.name, state.velocity, config.max_speed));
    require(state.position >= *config.min_position - 1.01 * step &&
                state.position <= *config.max_position + 1.01 * step,
            fmt::format("{} is at {} m, within its limits", config.name, state.position));
    // With a backlash the motor moves on its own while it is taken up.
    const auto pulses = static_cast<double>(bench_.pulses(config.name));
    require(std::abs(pulses * step - state.slack - state.position) < 1e-9,
            fmt::format("{} is at {} m after {} pulses", config.name, state.position, pulses));
  }

  void checkEnd(const motion::TrajectoryRequest& request, const machine::CoordinatedMove& move) {
    const machine::CoordinatedResult result = bench_.machine->wait(move);
    require(result.end == axis::MoveEnd::kReached,
            "an accepted trajectory is followed to its end: " + result.message);
    for (std::size_t i = 0; i < request.names.size(); ++i) {
      const double wanted = request.points.back().positions[i];
      require(std::abs(result.positions[i] - wanted) <= 0.501 / kScale,
              fmt::format("{} comes to rest at {} m, the last point is {} m", request.names[i],
                          result.positions[i], wanted));
    }
    check();
  }

  void stop() {
    bench_.machine->stop();
    // The slowest stop is 0.5 m/s with 2 m/s^2 and 40 m/s^3, along a path whose acceleration counts
    // too.
    for (int i = 0; i < 20; ++i) {
      bench_.machine->advance(0.05);
      check();
    }
    for (const AxisConfig& config : configs_) {
      require(!bench_.axis(config.name).state().moving,
              config.name + " rests a second after a stop");
    }
  }

  const std::vector<AxisConfig>& configs_;
  test::Bench bench_;
};

}  // namespace
}  // namespace stepdriver::fuzz

// NOLINTNEXTLINE(readability-identifier-naming): the name that libFuzzer calls
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stepdriver::fuzz;
  FuzzedDataProvider input(data, size);
  const auto configs = readAxes(input);
  const auto request = readRequest(input);
  Follower(configs).follow(request);
  return 0;
}
