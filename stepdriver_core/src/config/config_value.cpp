#include "stepdriver_core/config/config_value.h"

#include <set>

#include "message_text.h"
#include "printable.h"

namespace stepdriver::config {
namespace {

/// Adds a decimal point if the text would look like an int: the difference matters here.
std::string doubleText(double number) {
  const std::string text = numberText(number);
  return text.find_first_not_of("-0123456789") == std::string::npos ? text + ".0" : text;
}

}  // namespace

std::vector<std::string> ConfigValue::orderedKeys() const {
  std::vector<std::string> keys;
  const auto* map = as<Map>();
  if (map == nullptr) return keys;
  std::set<std::string> ordered;
  for (const std::string& key : key_order_) {
    if (map->count(key) > 0 && ordered.insert(key).second) keys.push_back(key);
  }
  for (const auto& entry : *map) {
    if (ordered.count(entry.first) == 0) keys.push_back(entry.first);
  }
  return keys;
}

std::string ConfigValue::shown() const {
  if (const auto* flag = as<bool>()) return *flag ? "true" : "false";
  if (const auto* integer = as<int>()) return std::to_string(*integer);
  if (const auto* number = as<double>()) return doubleText(*number);
  if (const auto* text = as<std::string>()) return '"' + printable(*text) + '"';
  if (const auto* list = as<List>()) return "a list of " + std::to_string(list->size());
  if (const auto* map = as<Map>()) return "a map of " + std::to_string(map->size());
  return "nothing";
}

}  // namespace stepdriver::config
