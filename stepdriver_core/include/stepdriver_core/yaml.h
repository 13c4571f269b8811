#pragma once

#include <string>

#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/setup/machine_config.h"

/// Configurations in YAML: the files that `rosparam load` gives the node. It is a library of its
/// own, stepdriver_core_yaml, because it needs yaml-cpp.
namespace stepdriver::yaml {

/// Reads the configuration of a machine, as docs/parameters.md describes it. Keys that only the ROS
/// node heeds are left alone.
///
/// @throw Error if the file can't be read or isn't YAML; it begins with `file:line:column:`.
/// @throw ConfigError with everything that is wrong.
setup::MachineConfig readFile(const std::string& path,
                              setup::BackendChoice choice = setup::BackendChoice::kAsInTheFile);

/// Loads a file as `rosparam load` puts it on the parameter server: plain scalars are resolved by
/// the rules of YAML 1.1 (`yes` and `off` are booleans, 017 an int, 1e3 a string), deg(90) and
/// rad(pi/2) are angles in rad, aliases and merge keys (<<) are replaced by what they mean. It is
/// stricter in one thing: a key that occurs twice is an error, where rosparam takes the last.
///
/// @throw Error beginning with `file:line:column:`, counted from 1.
config::ConfigValue load(const std::string& path);

/// The same for a text. @param name in place of the file's, for messages.
config::ConfigValue parse(const std::string& text, const std::string& name);

/// The text of a configuration. load() and rosparam read it back as the same.
std::string textOf(const config::ConfigValue& value);

}  // namespace stepdriver::yaml
