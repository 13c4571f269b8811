#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/config_value.h"

namespace stepdriver::console {

/// A configuration as YAML, which `rosparam load` and stepdriver_check read as the same again.
///
/// @param parameters a map.
/// @param comment lines that stand before it.
std::string configurationText(const config::ConfigValue& parameters,
                              const std::vector<std::string>& comment);

/// @throw Error where a file is there and isn't to be replaced.
void checkNewFile(const std::string& path, bool replace);

/// Writes the file as a whole, or not at all.
///
/// @throw Error as checkNewFile(), and where it can't be written.
void writeFile(const std::string& path, const std::string& text, bool replace);

}  // namespace stepdriver::console
