#include "stepdriver_core/config/config_value.h"

#include "message_text.h"
#include "stepdriver_core/printable.h"

namespace stepdriver::config {
namespace {

/// Adds a decimal point if the text would look like an int: the difference matters here.
std::string doubleText(double number) {
  const std::string text = numberText(number);
  return text.find_first_not_of("-0123456789") == std::string::npos ? text + ".0" : text;
}

}  // namespace

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
