#include "robot_description.h"

#include <fmt/format.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <limits>
#include <optional>

#include "common/text.h"
#include "stepdriver_core/config/axis_config.h"
#include "xml_mistake.h"

namespace stepdriver::ros_node {
namespace {

// The relative error of a number with six digits.
constexpr double kRounding = 1e-5;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using config::AxisConfig;
using config::Kind;
using config::LimitSource;

const char* typeName(const urdf::Joint& joint) {
  switch (joint.type) {
    case urdf::Joint::REVOLUTE:
      return "revolute";
    case urdf::Joint::CONTINUOUS:
      return "continuous";
    case urdf::Joint::PRISMATIC:
      return "prismatic";
    case urdf::Joint::FLOATING:
      return "floating";
    case urdf::Joint::PLANAR:
      return "planar";
    case urdf::Joint::FIXED:
      return "fixed";
    default:
      return "of an unknown type";
  }
}

/// Fits one axis to its joint.
class JointFitter {
 public:
  JointFitter(AxisConfig& axis, std::string name, std::vector<ConfigIssue>& issues)
      : axis_(axis), name_(std::move(name)), issues_(issues) {}

  void fit(const urdf::Joint* joint) {
    if (joint == nullptr) {
      issue(fmt::format("has no joint \"{}\", which is the joint of axis {}", axis_.joint,
                        axis_.name));
    } else if (checkType(*joint) && checkLimits(*joint)) {
      tighten(*joint);
      const bool limited = axis_.min_position || axis_.max_position;
      if (joint->type == urdf::Joint::CONTINUOUS && !limited) axis_.continuous = true;
    }
  }

 private:
  void issue(const std::string& message) { issues_.push_back({name_, message}); }

  /// @param message the mistake, to follow the joint's name.
  void issueOfJoint(const std::string& message) {
    issue(fmt::format("is wrong: joint \"{}\" of axis {} {}", axis_.joint, axis_.name, message));
  }

  bool checkType(const urdf::Joint& joint) {
    const bool linear = joint.type == urdf::Joint::PRISMATIC;
    const bool rotary =
        joint.type == urdf::Joint::REVOLUTE || joint.type == urdf::Joint::CONTINUOUS;
    if (axis_.kind == Kind::kLinear && !linear) {
      issueOfJoint(fmt::format("is {}, but must be prismatic: the axis is configured in mm",
                               typeName(joint)));
      return false;
    }
    if (axis_.kind == Kind::kRotary && !rotary) {
      issueOfJoint(fmt::format(
          "is {}, but must be revolute or continuous: the axis is configured in degrees",
          typeName(joint)));
      return false;
    }
    if (axis_.continuous && joint.type != urdf::Joint::CONTINUOUS) {
      issueOfJoint("is revolute, but must be continuous: the axis has continuous: true");
      return false;
    }
    return true;
  }

  bool checkLimits(const urdf::Joint& joint) {
    const bool limited = joint.type != urdf::Joint::CONTINUOUS;
    if (!joint.limits) {
      if (limited) issueOfJoint("has no <limit>, which a joint of that type must have");
      return !limited;
    }
    const urdf::JointLimits& limits = *joint.limits;
    bool right = true;
    if (!(limits.velocity > 0.0)) {
      issueOfJoint(fmt::format("has the velocity limit {}, but it must be above 0",
                               roundedText(limits.velocity)));
      right = false;
    } else if (const double lowest = lowestSpeed(); limits.velocity < lowest) {
      issueOfJoint(fmt::format(
          "has the velocity limit {}, but it must be at least {} {}/s, which is {} steps/s",
          roundedText(limits.velocity), roundedText(lowest), config::unitOf(axis_.kind),
          roundedText(config::kLowestRate)));
      right = false;
    }
    if (limited && !(limits.lower < limits.upper)) {
      issueOfJoint(fmt::format(
          "has lower={} and upper={}, but lower must be below upper (a missing one is 0)",
          roundedText(limits.lower), roundedText(limits.upper)));
      right = false;
    } else if (limited && isTooFar(limits)) {
      const double counted = config::kFarthestLimit / axis_.steps_per_unit;
      issueOfJoint(fmt::format(
          "has lower={} and upper={}, but a part of that must be from -{} to {} {}, which is as "
          "far as steps are counted",
          roundedText(limits.lower), roundedText(limits.upper), roundedText(counted),
          roundedText(counted), config::unitOf(axis_.kind)));
      right = false;
    } else if (const Range range = rangeOf(joint); limited && !(range.lower < range.upper)) {
      issueOfJoint(fmt::format(
          "has a safety_controller with soft_lower_limit={} and soft_upper_limit={} (a missing one "
          "is 0), which leaves nothing of its limits, {} to {}",
          roundedText(joint.safety->soft_lower_limit), roundedText(joint.safety->soft_upper_limit),
          roundedText(limits.lower), roundedText(limits.upper)));
      right = false;
    }
    return right;
  }

  /// [unit] As far as steps are counted. A limit beyond, such as 1e16, limits nothing.
  double farthest() const {
    return config::kFarthestLimit * (1.0 + kRounding) / axis_.steps_per_unit;
  }

  /// Whether no position of the joint has a step that is counted.
  bool isTooFar(const urdf::JointLimits& limits) const {
    return limits.lower > farthest() || limits.upper < -farthest();
  }

  /// The limits of the position with those of the joint's safety_controller, which gives none if
  /// both are 0, as missing ones are.
  struct Range {
    double lower;
    double upper;
  };
  static Range rangeOf(const urdf::Joint& joint) {
    Range range{joint.limits->lower, joint.limits->upper};
    if (hasSoftLimits(joint)) {
      range.lower = std::max(range.lower, joint.safety->soft_lower_limit);
      range.upper = std::min(range.upper, joint.safety->soft_upper_limit);
    }
    return range;
  }
  static bool hasSoftLimits(const urdf::Joint& joint) {
    return joint.safety &&
           (joint.safety->soft_lower_limit != 0.0 || joint.safety->soft_upper_limit != 0.0);
  }

  /// [unit/s] 0 if the scale of the axis is not known.
  double lowestSpeed() const {
    // A value copied from the message, with its six digits, is accepted.
    return axis_.steps_per_unit > 0.0
               ? config::kLowestRate / axis_.steps_per_unit * (1.0 - kRounding)
               : 0.0;
  }

  void tighten(const urdf::Joint& joint) {
    if (!joint.limits) return;
    const urdf::JointLimits& limits = *joint.limits;
    if (limits.velocity < axis_.max_speed) {
      axis_.max_speed = limits.velocity;
      axis_.start_speed = std::min(axis_.start_speed, axis_.max_speed);
      axis_.max_speed_source = LimitSource::kRobotDescription;
    }
    if (joint.type == urdf::Joint::CONTINUOUS) return;
    const Range range = rangeOf(joint);
    if (range.lower >= -farthest() && range.lower > axis_.min_position.value_or(-kInfinity)) {
      axis_.min_position = range.lower;
      axis_.min_position_source = LimitSource::kRobotDescription;
    }
    if (range.upper <= farthest() && range.upper < axis_.max_position.value_or(kInfinity)) {
      axis_.max_position = range.upper;
      axis_.max_position_source = LimitSource::kRobotDescription;
    }
    if (axis_.min_position.value_or(-kInfinity) < axis_.max_position.value_or(kInfinity)) return;
    issueOfJoint(fmt::format("goes from {} to {} {}, which doesn't overlap the axis's own range",
                             roundedText(range.lower), roundedText(range.upper),
                             config::unitOf(axis_.kind)));
  }

  AxisConfig& axis_;
  std::string name_;
  std::vector<ConfigIssue>& issues_;
};

std::string positionText(const std::optional<double>& position, Kind kind, LimitSource source) {
  if (!position) return "none";
  return fmt::format("{} {} (from {})", roundedText(*position), config::unitOf(kind),
                     sourceText(source));
}

std::string continuousJointText(const AxisConfig& axis) {
  return fmt::format(
      "axis {} has soft limits, but its joint {} is continuous in the robot description: the "
      "limits apply, and a planner that uses the description will ask for positions that are "
      "refused. "
      "Make the joint revolute, or remove the limits",
      axis.name, axis.joint);
}

}  // namespace

std::vector<std::string> applyRobotDescription(const std::string& urdf, const std::string& name,
                                               std::vector<AxisConfig>& axes,
                                               std::vector<ConfigIssue>& issues) {
  std::vector<std::string> warnings;
  if (const std::string mistake = mistakeInXml(urdf); !mistake.empty()) {
    issues.push_back({name, "can't be read as XML: " + mistake});
    return warnings;
  }
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(urdf);
  if (!model) {
    issues.push_back(
        {name,
         "can't be read as a URDF; the parser's messages are above. Common reasons: a prismatic "
         "or revolute joint without <limit effort=... velocity=...>, a number such as inf, or a "
         "xacro file that xacro has not processed"});
    return warnings;
  }
  for (AxisConfig& axis : axes) {
    const urdf::JointConstSharedPtr joint = model->getJoint(axis.joint);
    JointFitter(axis, name, issues).fit(joint.get());
    if (joint && joint->type == urdf::Joint::CONTINUOUS &&
        (axis.min_position || axis.max_position)) {
      warnings.push_back(continuousJointText(axis));
    }
    if (joint && joint->mimic) {
      warnings.push_back(fmt::format(
          "axis {} has the joint {}, which mimics {} in the robot description: programs that use "
          "the description compute its position from that joint and never command it. Remove the "
          "<mimic>, or make its motor one of the motors of the other axis",
          axis.name, axis.joint, joint->mimic->joint_name));
    }
  }
  return warnings;
}

std::string limitsText(const AxisConfig& axis) {
  return fmt::format(
      "limits of axis {} (joint {}): min position {}, max position {}, speed {} {}/s (from {})",
      axis.name, axis.joint, positionText(axis.min_position, axis.kind, axis.min_position_source),
      positionText(axis.max_position, axis.kind, axis.max_position_source),
      roundedText(axis.max_speed), config::unitOf(axis.kind), sourceText(axis.max_speed_source));
}

}  // namespace stepdriver::ros_node
