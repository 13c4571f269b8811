#pragma once

#include <string>

#include "stepdriver_core/config/config_value.h"

namespace stepdriver::yaml {

/// Resolves a plain scalar of YAML 1.1 like PyYAML and rosparam: yes and off are booleans, 0x1F,
/// 017 and 1_000 are ints, 1.5e+3 is a double (but 1e3 is a string), deg(90) and rad(pi/2) are
/// angles in rad.
///
/// @throw Error if rosparam would refuse it; its text continues a message that begins with the
///   scalar's position in the file.
config::ConfigValue resolveScalar(const std::string& text);

/// The same if a tag gives the type: `int`, `float`, `bool`, `str` or `null`.
config::ConfigValue resolveTagged(const std::string& text, const std::string& type);

}  // namespace stepdriver::yaml
