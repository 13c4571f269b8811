#include "base_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "common/text.h"
#include "config/config_reader.h"

namespace stepdriver::base {
namespace {

using config::ConfigReader;
using config::ConfigValue;
using config::Presence;
using config::Range;

constexpr Range kRates{1.0, 1000.0};
constexpr Range kCommandTimeouts{0.02, 60.0};
// The driver reports ten times a second.
constexpr Range kDriverTimeouts{0.2, 60.0};
constexpr Range kAngles{0.0, 90.0, true};
constexpr double kDefaultAngle = 85.0;  // [deg]
// With such a value, a wheel in the middle could turn the base on the spot only by not turning.
constexpr double kMostAngleOfMiddle = 85.0;                  // [deg]
constexpr double kMillimetres = 1000.0;                      // [mm/m]
constexpr double kDegrees = 180.0 / 3.14159265358979323846;  // [deg/rad]
constexpr std::ptrdiff_t kMostWheelsOfSide = 2;

std::optional<double> finiteNumber(const ConfigValue& value) {
  if (const int* integer = value.as<int>()) return *integer;
  const double* real = value.as<double>();
  return real != nullptr && std::isfinite(*real) ? std::optional<double>(*real) : std::nullopt;
}

Variances readVariances(ConfigReader& reader, const std::string& key) {
  Variances variances{};
  reader.allow(key);
  if (!reader.has(key)) return variances;
  const auto* list = reader.value(key).as<ConfigValue::List>();
  bool right = list != nullptr && list->size() == variances.size();
  std::string shown = list == nullptr ? reader.shown(key) : "";
  for (std::size_t i = 0; list != nullptr && i < list->size(); ++i) {
    const auto number = finiteNumber((*list)[i]);
    right = right && number && *number >= 0.0;
    if (right) variances[i] = *number;
    shown += (i == 0 ? "" : ", ") + (*list)[i].shown();
  }
  if (!right) {
    reader.issue(key, fmt::format("is {}, but must be a list of 6 numbers, each 0 or more",
                                  list == nullptr ? shown : "[" + shown + "]"));
  }
  return variances;
}

/// The name of a frame as tf2 takes it.
std::string readFrame(ConfigReader& reader, const std::string& key, const std::string& fallback) {
  std::string frame = reader.text(key, fallback);
  if (frame.empty() || frame.front() == '/') {
    reader.issue(
        key,
        fmt::format("is \"{}\", but must be the name of a frame, without a / in front", frame));
  }
  return frame;
}

WheelConfig readWheel(const std::string& name, ConfigReader reader) {
  config::checkAxisName(name, reader);
  WheelConfig wheel;
  wheel.axis = name;
  const std::string side = reader.oneOf("side", {"left", "right", "middle", "steered"});
  if (side == "right") wheel.side = Side::kRight;
  if (side == "middle") wheel.side = Side::kMiddle;
  if (side == "steered") wheel.side = Side::kSteered;
  const auto diameter = reader.findNumber("diameter_mm", Range::positive(), Presence::kOptional);
  if (diameter) wheel.diameter = *diameter / kMillimetres;
  reader.rejectUnknown();
  return wheel;
}

std::vector<WheelConfig> readWheels(ConfigReader& reader) {
  std::vector<WheelConfig> wheels;
  if (!reader.isMap()) return wheels;
  reader.allow("wheels");
  if (!reader.has("wheels")) {
    reader.issue("wheels", "is missing; it must be a map of the driven wheels");
    return wheels;
  }
  ConfigReader each = reader.map("wheels");
  for (const std::string& name : each.keys()) wheels.push_back(readWheel(name, each.map(name)));
  return wheels;
}

std::optional<SteeringConfig> readSteering(ConfigReader& reader) {
  reader.allow("steering");
  if (!reader.has("steering")) return {};
  ConfigReader map = reader.map("steering");
  SteeringConfig steering;
  steering.axis = map.text("axis");
  steering.wheelbase = map.number("wheelbase_mm", Range::positive()) / kMillimetres;
  steering.max_angle = map.number("max_angle_deg", kAngles, kDefaultAngle) / kDegrees;
  map.rejectUnknown();
  return steering;
}

std::ptrdiff_t countAt(const std::vector<WheelConfig>& wheels, Side side) {
  return std::count_if(wheels.begin(), wheels.end(),
                       [side](const WheelConfig& wheel) { return wheel.side == side; });
}

void checkWheels(const BaseConfig& config, ConfigReader& reader) {
  const std::ptrdiff_t left = countAt(config.wheels, Side::kLeft);
  const std::ptrdiff_t right = countAt(config.wheels, Side::kRight);
  const std::ptrdiff_t middle = countAt(config.wheels, Side::kMiddle);
  const std::ptrdiff_t steered = countAt(config.wheels, Side::kSteered);
  const std::string found =
      fmt::format("has {} left, {} right, {} middle and {} steered", left, right, middle, steered);
  if (!config.steering) {
    if (left == right && left >= 1 && left <= kMostWheelsOfSide && middle + steered == 0) return;
    reader.issue("wheels", found +
                               ", but without a steering there must be one left and one right "
                               "wheel, or two of each");
    return;
  }
  const std::ptrdiff_t all = left + right + middle + steered;
  if (!(all == 1 && middle + steered == 1) && !(all == 2 && left == 1 && right == 1)) {
    reader.issue("wheels", found +
                               ", but with a steering there must be one steered wheel, or one in "
                               "the middle, or one left and one right");
  }
  if (middle > 0 && config.steering->max_angle * kDegrees > kMostAngleOfMiddle + 1e-9) {
    reader.issue("steering/max_angle_deg",
                 fmt::format("is {}, but must be at most {} with a wheel in the middle, which "
                             "doesn't turn if the steering is square to it",
                             ros_node::roundedText(config.steering->max_angle * kDegrees),
                             ros_node::roundedText(kMostAngleOfMiddle)));
  }
}

void readSeparation(BaseConfig& config, ConfigReader& reader) {
  const bool sides = countAt(config.wheels, Side::kLeft) + countAt(config.wheels, Side::kRight) > 0;
  const auto separation = reader.findNumber("separation_mm", Range::positive(),
                                            sides ? Presence::kRequired : Presence::kOptional);
  if (separation) config.separation = *separation / kMillimetres;
}

}  // namespace

BaseConfig readBaseConfig(const ConfigValue& tree, const std::string& name,
                          std::vector<ConfigIssue>& issues) {
  BaseConfig config;
  ConfigReader reader(tree, name, issues);
  config.driver = reader.text("driver", config.driver);
  config.rate = reader.number("rate", kRates, config.rate);
  config.cmd_vel_timeout =
      reader.number("cmd_vel_timeout", kCommandTimeouts, config.cmd_vel_timeout);
  config.driver_timeout = reader.number("driver_timeout", kDriverTimeouts, config.driver_timeout);
  config.odom_frame = readFrame(reader, "odom_frame", config.odom_frame);
  config.base_frame = readFrame(reader, "base_frame", config.base_frame);
  if (config.odom_frame == config.base_frame) {
    reader.issue("base_frame",
                 fmt::format("is \"{}\", but must differ from odom_frame", config.base_frame));
  }
  config.publish_tf = reader.boolean("publish_tf", config.publish_tf);
  config.pose_variances = readVariances(reader, "pose_covariance_diagonal");
  config.twist_variances = readVariances(reader, "twist_covariance_diagonal");
  const std::size_t before = issues.size();
  config.wheels = readWheels(reader);
  config.steering = readSteering(reader);
  // What is wrong in itself is not compared.
  if (reader.isMap() && issues.size() == before) checkWheels(config, reader);
  readSeparation(config, reader);
  reader.rejectUnknown();
  return config;
}

}  // namespace stepdriver::base
