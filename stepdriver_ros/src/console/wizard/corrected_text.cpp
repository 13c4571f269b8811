#include "corrected_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>

#include "stepdriver_core/error.h"
#include "stepdriver_core/yaml.h"
#include "yaml_text.h"

namespace stepdriver::console {
namespace {

using config::ConfigValue;
using Map = ConfigValue::Map;

// The order of keys makes no difference.
bool same(const ConfigValue& one, const ConfigValue& other) {
  const Map* const map = one.as<Map>();
  const Map* const other_map = other.as<Map>();
  if (map == nullptr || other_map == nullptr) return yaml::textOf(one) == yaml::textOf(other);
  return map->size() == other_map->size() &&
         std::all_of(map->begin(), map->end(), [&](const auto& entry) {
           const auto found = other_map->find(entry.first);
           return found != other_map->end() && same(entry.second, found->second);
         });
}

/// What a text means; nothing if an edit has made it unreadable.
std::optional<ConfigValue> meaningOf(const std::string& text) {
  try {
    return yaml::parse(text, "the edited text");
  } catch (const Error&) {
    return {};
  }
}

/// A value that is another one, or missing.
struct Difference {
  KeyPath path;
  ConfigValue wanted;
};

void compare(const Map& is, const Map& wanted, const KeyPath& above,
             std::vector<Difference>& differences) {
  for (const auto& [key, value] : wanted) {
    KeyPath path = above;
    path.push_back(key);
    const auto found = is.find(key);
    const Map* const below = found == is.end() ? nullptr : found->second.as<Map>();
    if (below != nullptr && value.as<Map>() != nullptr) {
      compare(*below, *value.as<Map>(), path, differences);
    } else if (found == is.end() || !same(found->second, value)) {
      differences.push_back({path, value});
    }
  }
}

std::vector<Difference> differencesOf(const ConfigValue& is, const ConfigValue& wanted) {
  std::vector<Difference> differences;
  compare(*is.as<Map>(), *wanted.as<Map>(), {}, differences);
  return differences;
}

/// Notes the keys that must go: no edit removes any.
void noteSurplus(const Map& is, const Map& wanted, const KeyPath& above,
                 std::vector<std::string>& notes) {
  for (const auto& [key, value] : is) {
    KeyPath path = above;
    path.push_back(key);
    const auto found = wanted.find(key);
    if (found == wanted.end()) {
      notes.push_back(fmt::format("{}: remove this key", fmt::join(path, "/")));
    } else if (value.as<Map>() != nullptr && found->second.as<Map>() != nullptr) {
      noteSurplus(*value.as<Map>(), *found->second.as<Map>(), path, notes);
    }
  }
}

/// Sets the value in a tree that has the maps above it.
void set(ConfigValue& tree, const Difference& difference) {
  ConfigValue* value = &tree;
  for (const std::string& key : difference.path) value = &(*value->as<Map>())[key];
  *value = difference.wanted;
}

std::string byHand(const Difference& difference) {
  std::string value = yaml::textOf(difference.wanted);
  value.erase(value.find_last_not_of('\n') + 1);
  if (difference.wanted.as<Map>() != nullptr) {
    std::string all;
    for (const auto& [key, below] : *difference.wanted.as<Map>()) {
      KeyPath path = difference.path;
      path.push_back(key);
      all += (all.empty() ? "" : ", ") + byHand({path, below});
    }
    return all;
  }
  return fmt::format("{}: {}", fmt::join(difference.path, "/"), value);
}

/// Takes an edit if the text then means exactly what is wanted.
bool replaceIfMeant(std::string& text, const std::optional<std::string>& edited,
                    const ConfigValue& wanted) {
  if (!edited) return false;
  const auto meaning = meaningOf(*edited);
  if (!meaning || !same(*meaning, wanted)) return false;
  text = *edited;
  return true;
}

/// Makes the changes in the text, and in what it means. @return false: one can't be made.
bool change(std::string& text, ConfigValue& meaning, const std::vector<Findings>& findings,
            const ConfigValue& wanted) {
  for (const Findings& one : findings) {
    if (!one.switches_swapped) continue;
    Findings only_swap;
    only_swap.axis = one.axis;
    only_swap.switches_swapped = true;
    meaning = corrected(std::move(meaning), only_swap);
    const KeyPath endstops = {"axes", one.axis, "endstops"};
    if (!replaceIfMeant(text, withKeysSwapped(text, endstops, "min", "max"), meaning)) return false;
  }
  for (const Difference& difference : differencesOf(meaning, wanted)) {
    set(meaning, difference);
    // A key that is there may come from a merged map (<<): a key of the map itself overrides it.
    if (!replaceIfMeant(text, withScalar(text, difference.path, difference.wanted), meaning) &&
        !replaceIfMeant(text, withNewKey(text, difference.path, difference.wanted), meaning)) {
      return false;
    }
  }
  return same(meaning, wanted);
}

}  // namespace

CorrectedText correctedText(const std::string& text, const std::vector<Findings>& findings) {
  const ConfigValue before = yaml::parse(text, "the configuration");
  ConfigValue wanted = before;
  for (const Findings& one : findings) wanted = corrected(std::move(wanted), one);
  CorrectedText result{text, {}};
  ConfigValue meaning = before;
  if (change(result.text, meaning, findings, wanted)) return result;
  result.text = text;
  noteSurplus(*before.as<Map>(), *wanted.as<Map>(), {}, result.by_hand);
  for (const Difference& difference : differencesOf(before, wanted)) {
    result.by_hand.push_back(byHand(difference));
  }
  return result;
}

}  // namespace stepdriver::console
