#pragma once

#include <string>

#include "stepdriver_core/config/config_value.h"

namespace stepdriver::yaml {

/// A plain scalar of YAML 1.1, as PyYAML and rosparam resolve it: yes and off are booleans, 0x1F,
/// 017 and 1_000 ints, 1.5e+3 a double (but 1e3 a string), deg(90) and rad(pi/2) angles in rad.
///
/// @throw Error where rosparam would refuse it; its text reads on from the place of the scalar.
config::ConfigValue resolveScalar(const std::string& text);

/// The same where the type is given by a tag: `int`, `float`, `bool`, `str` or `null`.
config::ConfigValue resolveTagged(const std::string& text, const std::string& type);

}  // namespace stepdriver::yaml
