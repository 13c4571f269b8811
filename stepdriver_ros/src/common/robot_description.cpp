#include "robot_description.h"

#include <fmt/format.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/text.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/farthest_limit.h"
#include "xml_mistake.h"

namespace stepdriver::ros_node {
namespace {

// The relative error of a number with six digits.
constexpr double kRounding = 1e-5;

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
      const double farthest = config::kFarthestLimit / axis_.steps_per_unit;
      issueOfJoint(fmt::format(
          "has lower={} and upper={}, but they must be from -{} to {} {}, which is as far as steps "
          "are counted",
          roundedText(limits.lower), roundedText(limits.upper), roundedText(farthest),
          roundedText(farthest), config::unitOf(axis_.kind)));
      right = false;
    }
    return right;
  }

  /// Whether a limit that the axis would get is beyond the steps that are counted.
  bool isTooFar(const urdf::JointLimits& limits) const {
    const double farthest = config::kFarthestLimit * (1.0 + kRounding);
    const auto is_too_far = [&](const std::optional<double>& own, double limit) {
      return !own && std::abs(limit) * axis_.steps_per_unit > farthest;
    };
    return is_too_far(axis_.min_position, limits.lower) ||
           is_too_far(axis_.max_position, limits.upper);
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
    if (!axis_.min_position || limits.lower > *axis_.min_position) {
      axis_.min_position = limits.lower;
      axis_.min_position_source = LimitSource::kRobotDescription;
    }
    if (!axis_.max_position || limits.upper < *axis_.max_position) {
      axis_.max_position = limits.upper;
      axis_.max_position_source = LimitSource::kRobotDescription;
    }
    if (*axis_.min_position < *axis_.max_position) return;
    issueOfJoint(fmt::format("goes from {} to {} {}, which doesn't overlap the axis's own range",
                             roundedText(limits.lower), roundedText(limits.upper),
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
         "can't be read as a URDF; the parser's messages are above. A common reason: a prismatic "
         "or revolute joint without <limit effort=... velocity=...>"});
    return warnings;
  }
  for (AxisConfig& axis : axes) {
    const urdf::JointConstSharedPtr joint = model->getJoint(axis.joint);
    JointFitter(axis, name, issues).fit(joint.get());
    if (joint && joint->type == urdf::Joint::CONTINUOUS &&
        (axis.min_position || axis.max_position)) {
      warnings.push_back(continuousJointText(axis));
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
