#pragma once

#include <string>
#include <vector>

#include "base_config.h"
#include "common/node_config.h"
#include "kinematics.h"
#include "stepdriver_core/error.h"

namespace stepdriver::base {

/// An axis of the driver that belongs to the base.
struct DrivenAxis {
  std::string axis;
  std::string joint;  ///< its name in joint_states
};

/// The base as made of axes of the driver.
struct DriverWheels {
  Kinematics kinematics;           ///< with the limits of the axes
  std::vector<DrivenAxis> wheels;  ///< in the order of the kinematics
  DrivenAxis steering;             ///< if the kinematics have one
};

/// Finds the axes of the base in the driver's configuration, and takes their scale and limits from
/// there.
///
/// @param base, name the node's parameters as read by readBaseConfig().
/// @param driver_config the driver's, with the limits of the robot description.
/// @param driver full name of the driver.
/// @param issues every mismatch is added here.
/// @return to be used only if no issue was added.
DriverWheels driverWheels(const BaseConfig& base, const std::string& name,
                          const ros_node::NodeConfig& driver_config, const std::string& driver,
                          std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::base
