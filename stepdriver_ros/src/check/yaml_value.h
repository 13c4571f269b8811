#pragma once

#include <string>

#include "stepdriver_core/axis/config_value.h"

namespace stepdriver::check {

/// A YAML file as `rosparam load` puts it on the parameter server: types as resolveScalar() says,
/// aliases and merge keys (<<) resolved. Stricter in one thing: a key that is there twice is an
/// error, where rosparam takes the last.
///
/// @throw Error beginning with `file:line:column:`, counted from 1.
axis::ConfigValue loadYaml(const std::string& path);

/// The same of text. @param name in place of the file's, for messages.
axis::ConfigValue parseYaml(const std::string& text, const std::string& name);

}  // namespace stepdriver::check
