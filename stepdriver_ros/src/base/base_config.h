#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/error.h"

namespace stepdriver::base {

/// The place of a wheel.
enum class Side {
  kLeft,
  kRight,
  kMiddle,  ///< in the middle of the rear axle of a tricycle
  kSteered  ///< the wheel in front of a tricycle, which also drives
};

struct WheelConfig {
  std::string axis;
  Side side = Side::kLeft;
  std::optional<double> diameter;  ///< [m] a wheel's, if its axis is rotary
};

struct SteeringConfig {
  std::string axis;
  double wheelbase = 0.0;  ///< [m]
  double max_angle = 0.0;  ///< [rad]
};

/// Variances of x, y, z, and of the rotations around x, y, z: the diagonal of a covariance.
using Variances = std::array<double, 6>;

/// All parameters of the node.
struct BaseConfig {
  std::string driver = "stepdriver";  ///< the name of the node that drives the axes
  double rate = 25.0;                 ///< [Hz] of the jog messages while the base drives
  double cmd_vel_timeout = 0.5;       ///< [s] without a command until the base comes to rest
  double driver_timeout = 0.5;        ///< [s] without a state of the driver until the wheels stop
  std::string odom_frame = "odom";
  std::string base_frame = "base_link";
  bool publish_tf = true;
  Variances pose_variances{};   ///< [m^2], [rad^2]
  Variances twist_variances{};  ///< [m^2/s^2], [rad^2/s^2]
  double separation = 0.0;      ///< [m] between the wheels on the left and on the right
  std::vector<WheelConfig> wheels;
  std::optional<SteeringConfig> steering;
};

/// Reads the node's private parameters.
///
/// @code{.yaml}
/// driver: stepdriver          # name of the stepdriver_node, as it is or in the namespace
/// rate: 25.0                  # [Hz] from 1 to 1000, of jog messages
/// cmd_vel_timeout: 0.5        # [s] from 0.02 to 60
/// driver_timeout: 0.5         # [s] from 0.2 to 60
/// odom_frame: odom
/// base_frame: base_link
/// publish_tf: true            # the transform from odom_frame to base_frame
/// pose_covariance_diagonal: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]   # x, y, z, roll, pitch, yaw
/// twist_covariance_diagonal: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
/// separation_mm: 300.0        # [mm] between left and right wheels; required if there are any
/// wheels:
///   left:                     # name of an axis of the driver
///     side: left              # left or right; with a steering, also middle or steered
///     diameter_mm: 100.0      # [mm] of a wheel on a rotary axis only
///   right: {side: right, diameter_mm: 100.0}
/// steering:                   # only a tricycle has one
///   axis: steer               # a rotary axis: 0 is straight ahead, left is positive
///   wheelbase_mm: 400.0       # [mm] from the rear axle to the steered wheel
///   max_angle_deg: 85.0       # [deg] above 0 and at most 90
/// @endcode
///
/// A differential drive has one or two wheels on each side. A tricycle is driven by its steered
/// wheel, by a wheel in the middle of the rear axle, or by one rear wheel on each side.
///
/// @param tree all of them, as one map.
/// @param name the node's full name.
/// @param issues every mistake is added here.
/// @return to be used only if no issue was added.
BaseConfig readBaseConfig(const config::ConfigValue& tree, const std::string& name,
                          std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::base
