#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/config_value.h"

namespace stepdriver::console {

/// The keys on the way to a value, from the top.
using KeyPath = std::vector<std::string>;

/// Edits of the text of a YAML file that leave all other text as it is. Each returns the new text,
/// or nothing if it doesn't know how to make the change, for example because the value is an alias.
/// The caller checks that the new text has the meaning that it wants.

/// Replaces a scalar. A comment behind it stays in its column if possible.
std::optional<std::string> withScalar(const std::string& text, const KeyPath& path,
                                      const config::ConfigValue& value);

/// Adds a key to a map that has other keys.
std::optional<std::string> withNewKey(const std::string& text, const KeyPath& path,
                                      const config::ConfigValue& value);

/// Exchanges two keys of a map. One of them may be missing: the other one is renamed then.
std::optional<std::string> withKeysSwapped(const std::string& text, const KeyPath& map,
                                           const std::string& one, const std::string& other);

}  // namespace stepdriver::console
