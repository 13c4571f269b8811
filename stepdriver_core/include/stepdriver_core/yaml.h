#pragma once

#include <string>

#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/setup/machine_config.h"

/// Configurations in YAML: the files that `rosparam load` gives the node. It is a library of its
/// own, stepdriver_core_yaml, because it needs yaml-cpp.
namespace stepdriver::yaml {

/// Reads the configuration of a machine, as docs/parameters.md describes it. It ignores keys that
/// only the ROS node uses.
///
/// @throw Error if the file can't be read or isn't YAML; it begins with `file:line:column:`.
/// @throw ConfigError listing every mistake.
///
/// @code{.cpp}
/// const setup::MachineConfig config =
///     yaml::readFile("a4988.yaml", setup::BackendChoice::kSimulated);
/// @endcode
setup::MachineConfig readFile(const std::string& path,
                              setup::BackendChoice choice = setup::BackendChoice::kAsInTheFile);

/// Loads a file like `rosparam load`: plain scalars follow the rules of YAML 1.1 (`yes` and `off`
/// are booleans, 017 is an int, 1e3 a string), deg(90) and rad(pi/2) are angles in rad, and aliases
/// and merge keys (<<) are resolved. It is stricter in one respect: a key that occurs twice is an
/// error, while rosparam uses the last one.
///
/// @throw Error beginning with `file:line:column:`, counted from 1.
config::ConfigValue load(const std::string& path);

/// The same for a text. @param name appears in messages instead of the file's name.
config::ConfigValue parse(const std::string& text, const std::string& name);

/// The text of a configuration. load() and rosparam read it back as the same configuration.
std::string textOf(const config::ConfigValue& value);

}  // namespace stepdriver::yaml
