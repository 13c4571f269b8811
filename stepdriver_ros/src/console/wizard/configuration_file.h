#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/config_value.h"

namespace stepdriver::console {

/// A configuration as YAML, which `rosparam load` and stepdriver_check read back as the same
/// configuration.
///
/// @param parameters a map.
/// @param comment lines at the top.
std::string configurationText(const config::ConfigValue& parameters,
                              const std::vector<std::string>& comment);

/// The text of a file that the driver was started with.
///
/// @param parameters of the node. The named axes must be the same in the file: the wizard measures
///   how the machine differs from them.
/// @throw Error if the file can't be read, or differs.
std::string readOwnFile(const std::string& path, const config::ConfigValue& parameters,
                        const std::vector<std::string>& axes);

/// @throw Error if the file exists and must not be replaced.
void checkNewFile(const std::string& path, bool replace);

/// Writes the whole file, or nothing.
///
/// @throw Error as checkNewFile(), and if it can't be written.
void writeFile(const std::string& path, const std::string& text, bool replace);

}  // namespace stepdriver::console
