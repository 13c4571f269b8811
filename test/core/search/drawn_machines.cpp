#include "search/drawn_machines.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>

#include "config/bounds.h"
#include "config/restart_speed.h"
#include "search/participants.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/error.h"
#include "support/corexy_bench.h"

namespace stepdriver::search {
namespace {

constexpr double kCoarsest = 20e3;  // microsteps/m
constexpr double kFinest = 400e3;
constexpr double kSlowest = 1e-3;        // m/s: 8 mm take 8 s
constexpr double kLongestRamp = 5.0;     // s
constexpr double kMostRampSteps = 10e3;  // of a motor, at full speed in the time of a ramp
/// Of an axis if each motor makes one [microsteps]: a millimetre in the coarsest scale, as the rig
/// has 25 mm.
constexpr double kMostWay = 20.0;
constexpr double kLowestPart = 0.0101;  // of a motor in the way of an axis: the reader has 0.01

/// In decades, or one of the bounds.
double within(double low, double high, const Draw& draw) {
  const double part = draw();
  if (part < 0.1) return low;
  if (part > 0.9) return high;
  return low * std::pow(high / low, draw());
}

double signOf(const Draw& draw) { return draw() < 0.5 ? -1.0 : 1.0; }

/// @param fastest [unit/s]
/// @param rate [steps/unit] the most of a motor
void drawMotion(config::AxisConfig& axis, double fastest, double rate, const Draw& draw) {
  const double highest = config::kHighestAcceleration / axis.steps_per_unit;
  axis.max_speed = within(kSlowest, fastest, draw);
  const double longest = std::min(kLongestRamp, kMostRampSteps / (axis.max_speed * rate));
  const double lowest = axis.max_speed / longest;
  axis.acceleration = within(lowest, highest, draw);
  axis.deceleration = within(lowest, highest, draw);
  if (draw() < 0.3) axis.stop_deceleration = within(axis.deceleration, highest, draw);
  const double most =
      std::max(axis.acceleration, axis.stop_deceleration.value_or(axis.deceleration));
  const double highest_jerk = config::kHighestJerk / axis.steps_per_unit;
  const double lowest_jerk = most / longest;
  axis.jerk =
      draw() < 0.5 || lowest_jerk > highest_jerk ? 0.0 : within(lowest_jerk, highest_jerk, draw);
}

std::vector<config::ShaperConfig> drawShapers(const Draw& draw) {
  static constexpr std::array<config::ShaperType, 4> kTypes = {
      config::ShaperType::kZv, config::ShaperType::kMzv, config::ShaperType::kEi,
      config::ShaperType::kTwoHumpEi};
  std::vector<config::ShaperConfig> shapers;
  for (int i = 0; i < (draw() < 0.5 ? 1 : 2); ++i) {
    const auto type = std::min<std::size_t>(3, static_cast<std::size_t>(4.0 * draw()));
    shapers.push_back(
        {kTypes.at(type),
         within(config::kLowestShaperFrequency, config::kHighestShaperFrequency, draw),
         draw() < 0.3 ? 0.0 : config::kMostShaperDamping * draw()});
  }
  return shapers;
}

config::Matrix drawMatrix(const Draw& draw) {
  config::Matrix matrix;
  for (int i = 0; i < 2; ++i) {
    matrix.push_back({signOf(draw) * within(kLowestPart, 10.0, draw),
                      draw() < 0.2 ? 0.0 : signOf(draw) * within(kLowestPart, 10.0, draw)});
  }
  return matrix;
}

/// [steps/unit] The most that a motor makes for it.
double rateOf(const std::vector<config::AxisConfig>& axes, const config::AxisConfig& axis) {
  if (!axis.kinematics) return axis.steps_per_unit;
  const std::size_t own = axis.kinematics->numberOf(axis.name);
  double rate = 0.0;
  for (std::size_t motor = 0; motor < axis.kinematics->axes.size(); ++motor) {
    rate =
        std::max(rate, std::abs(axis.kinematics->matrix[motor][own]) * axes[motor].steps_per_unit);
  }
  return rate;
}

// The fault outputs of the search's machines are on chips that have none, for the sake of the
// chip's times.
bool isAccepted(std::vector<config::AxisConfig> axes) {
  for (config::AxisConfig& axis : axes) {
    axis.fault.reset();
    for (config::MotorConfig& twin : axis.twins) twin.fault.reset();
  }
  try {
    config::checkAxes(axes);
  } catch (const ConfigError&) {
    return false;
  }
  return true;
}

std::vector<config::AxisConfig> drawOnce(int variant, const Draw& draw) {
  std::vector<config::AxisConfig> axes = configsOf(variant);
  const double common = within(kCoarsest, kFinest, draw);
  for (config::AxisConfig& axis : axes) {
    axis.steps_per_unit = axis.kinematics ? common : within(kCoarsest, kFinest, draw);
    // About 5 mm a revolution, in whole full steps.
    axis.steps_per_round =
        axis.microsteps * std::max(1.0, std::round(0.005 * axis.steps_per_unit / axis.microsteps));
  }
  if (axes[0].kinematics) {
    std::vector<config::AxisConfig> sharing(axes.begin(), axes.begin() + 2);
    const config::Matrix matrix = drawMatrix(draw);
    const auto inverse = config::inverseOf(matrix);
    if (!inverse) return {};
    for (const auto& row : *inverse) {
      if (std::abs(row[0]) + std::abs(row[1]) > kMostWay) return {};
    }
    test::share(sharing, matrix);
    for (std::size_t i = 0; i < sharing.size(); ++i) axes[i].kinematics = sharing[i].kinematics;
  }
  for (config::AxisConfig& axis : axes) {
    // All axes at once turn no motor faster than its chip allows.
    const double together =
        axis.kinematics ? static_cast<double>(axis.kinematics->axes.size()) : 1.0;
    const double rate = rateOf(axes, axis);
    drawMotion(axis, 1e9 / static_cast<double>(axis.shortestStepNs()) / rate / together, rate,
               draw);
    if (!axis.input_shaper.empty()) {
      axis.input_shaper = drawShapers(draw);
    } else {
      if (draw() < 0.3) {
        axis.start_speed = within(config::kLowestRate / axis.steps_per_unit, axis.max_speed, draw);
      }
      if (axis.backlash > 0.0) axis.backlash = within(0.4 / axis.steps_per_unit, 0.0005, draw);
    }
    if (!axis.homing) continue;
    const double restart = std::min(axis.max_speed, config::restartSpeed(axis));
    axis.homing->latch_speed = std::min(axis.homing->latch_speed, restart);
    axis.homing->seek_speed =
        std::min(axis.homing->seek_speed, axis.kinematics ? restart : axis.max_speed);
  }
  return isAccepted(axes) ? axes : std::vector<config::AxisConfig>();
}

}  // namespace

std::string describe(const config::AxisConfig& axis) {
  std::string text = fmt::format(
      "{}: {} steps/m, max speed {}, start speed {}, accelerations {}, {}, {}, jerk {}, backlash "
      "{}",
      axis.name, axis.steps_per_unit, axis.max_speed, axis.start_speed, axis.acceleration,
      axis.deceleration, axis.stop_deceleration.value_or(axis.deceleration), axis.jerk,
      axis.backlash);
  for (const config::ShaperConfig& shaper : axis.input_shaper) {
    text += fmt::format(", shaper {} of {} Hz with {}", static_cast<int>(shaper.type),
                        shaper.frequency, shaper.damping);
  }
  if (axis.kinematics) {
    for (const auto& row : axis.kinematics->matrix) {
      text += fmt::format(", [{}]", fmt::join(row, ", "));
    }
  }
  return text;
}

std::vector<config::AxisConfig> drawMachine(int variant, const Draw& draw) {
  constexpr int kMostTries = 200;
  for (int i = 0; i < kMostTries; ++i) {
    std::vector<config::AxisConfig> axes = drawOnce(variant, draw);
    if (!axes.empty()) return axes;
  }
  return configsOf(variant);
}

}  // namespace stepdriver::search
