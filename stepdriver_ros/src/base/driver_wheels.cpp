#include "driver_wheels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/text.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::base {
namespace {

using config::AxisConfig;
using config::Kind;

// How many messages should arrive in the driver's jog_timeout, so that a late one ends no jog.
constexpr double kMessagesInJogTimeout = 3.0;
constexpr double kRoundingOfNumber = 1e-9;
constexpr double kDegreesPerUnit = 180.0 / 3.14159265358979323846;

/// Compares the base with the axes of the driver.
class WheelFinder {
 public:
  WheelFinder(const BaseConfig& base, std::string name, const std::vector<AxisConfig>& axes,
              std::string driver, std::vector<ConfigIssue>& issues)
      : base_(base),
        name_(std::move(name)),
        axes_(axes),
        driver_(std::move(driver)),
        issues_(issues) {}

  void addWheel(const WheelConfig& wheel, DriverWheels& found) {
    const std::string key = "/wheels/" + wheel.axis;
    const AxisConfig* axis = axisOf(key, wheel.axis);
    if (axis == nullptr || !checkDiameter(key, wheel, *axis)) return;
    Wheel added;
    if (wheel.side == Side::kLeft) added.y = base_.separation / 2.0;
    if (wheel.side == Side::kRight) added.y = -base_.separation / 2.0;
    added.steered = wheel.side == Side::kSteered;
    added.travel = wheel.diameter ? *wheel.diameter / 2.0 : 1.0;
    added.max_speed = axis->max_speed;
    added.acceleration = axis->acceleration;
    added.deceleration = axis->deceleration;
    found.kinematics.wheels.push_back(added);
    found.wheels.push_back({axis->name, axis->joint});
  }

  void addSteering(const SteeringConfig& steering, DriverWheels& found) {
    const AxisConfig* axis = axisOf("/steering/axis", steering.axis);
    if (axis == nullptr) return;
    if (axis->kind != Kind::kRotary) {
      issue("/steering/axis", fmt::format("is {}, but must be a rotary axis: {}/axes/{} is in mm",
                                          steering.axis, driver_, steering.axis));
      return;
    }
    for (const WheelConfig& wheel : base_.wheels) {
      if (wheel.axis != steering.axis) continue;
      issue("/steering/axis",
            fmt::format("is {}, but must be an axis that isn't a wheel", steering.axis));
    }
    const double angle = steering.max_angle - kRoundingOfNumber;
    if ((axis->max_position && angle > *axis->max_position) ||
        (axis->min_position && -angle < *axis->min_position)) {
      const double most = std::min(axis->max_position.value_or(steering.max_angle),
                                   -axis->min_position.value_or(-steering.max_angle));
      issue("/steering/max_angle_deg",
            fmt::format("is {}, but must be at most {}, because of the limits of {}/axes/{}",
                        ros_node::roundedText(steering.max_angle * kDegreesPerUnit),
                        ros_node::roundedText(most * kDegreesPerUnit), driver_, steering.axis));
    }
    found.kinematics.steering = Steering{steering.wheelbase, steering.max_angle};
    found.steering = {axis->name, axis->joint};
  }

 private:
  void issue(const std::string& key, const std::string& message) {
    issues_.push_back({name_ + key, message, true});
  }

  const AxisConfig* axisOf(const std::string& key, const std::string& axis) {
    std::string names;
    for (const AxisConfig& each : axes_) {
      if (each.name == axis) return &each;
      names += (names.empty() ? "" : ", ") + each.name;
    }
    issue(key, fmt::format("{}isn't an axis of {}, which has {}",
                           key == "/steering/axis" ? "is \"" + axis + "\", which " : "", driver_,
                           names));
    return nullptr;
  }

  bool checkDiameter(const std::string& key, const WheelConfig& wheel, const AxisConfig& axis) {
    if (axis.kind == Kind::kLinear && wheel.diameter) {
      issue(key + "/diameter_mm",
            fmt::format("must not be given: {}/axes/{} is in mm, so its position is the distance",
                        driver_, axis.name));
      return false;
    }
    if (axis.kind == Kind::kRotary && !wheel.diameter) {
      issue(key + "/diameter_mm",
            fmt::format("is missing; it must be a number above 0, because {}/axes/{} is in degrees",
                        driver_, axis.name));
      return false;
    }
    return true;
  }

  const BaseConfig& base_;
  const std::string name_;
  const std::vector<AxisConfig>& axes_;
  const std::string driver_;
  std::vector<ConfigIssue>& issues_;
};

}  // namespace

DriverWheels driverWheels(const BaseConfig& base, const std::string& name,
                          const ros_node::NodeConfig& driver_config, const std::string& driver,
                          std::vector<ConfigIssue>& issues) {
  DriverWheels found;
  WheelFinder finder(base, name, driver_config.axes, driver, issues);
  for (const WheelConfig& wheel : base.wheels) finder.addWheel(wheel, found);
  if (base.steering) finder.addSteering(*base.steering, found);
  if (base.rate * driver_config.jog_timeout < kMessagesInJogTimeout - kRoundingOfNumber) {
    issues.push_back(
        {name + "/rate",
         fmt::format("is {}, but must be at least {}, so that three messages arrive in "
                     "{}/jog_timeout, which is {} s",
                     ros_node::roundedText(base.rate),
                     ros_node::roundedText(kMessagesInJogTimeout / driver_config.jog_timeout),
                     driver, ros_node::roundedText(driver_config.jog_timeout))});
  }
  return found;
}

}  // namespace stepdriver::base
