#include "config/config_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include "message_text.h"
#include "pattern.h"
#include "printable.h"

namespace stepdriver::config {
namespace {

const ConfigValue::Map kEmptyMap;

/// "above 0", to continue "must be"; empty if all numbers are allowed.
std::string boundsText(const Range& range) {
  const bool has_min = range.min > -std::numeric_limits<double>::infinity();
  const bool has_max = range.max < std::numeric_limits<double>::infinity();
  const std::string min = numberText(range.min);
  const std::string max = numberText(range.max);
  if (has_min && has_max) {
    return range.min_excluded ? fmt::format("above {} and at most {}", min, max)
                              : fmt::format("from {} to {}", min, max);
  }
  if (has_min) return range.min_excluded ? "above " + min : min + " or more";
  return has_max ? "at most " + max : "";
}

/// "a number above 0".
std::string wantedText(const std::string& noun, const Range& range) {
  const std::string bounds = boundsText(range);
  if (bounds.empty()) return noun;
  const bool adverb = bounds.rfind("above", 0) == 0 || bounds.rfind("from", 0) == 0;
  return noun + (adverb ? " " : " of ") + bounds;
}

/// The value, with its type unless the value alone shows it.
std::string shownWithType(const ConfigValue& value) {
  if (value.as<int>() != nullptr) return value.shown() + " (an integer)";
  if (value.as<double>() != nullptr) return value.shown() + " (a number with a decimal point)";
  if (value.as<std::string>() != nullptr) return value.shown() + " (a string)";
  if (value.as<bool>() != nullptr) return value.shown() + " (a boolean)";
  return value.shown();
}

/// How to write a number with an exponent that YAML 1.1 takes for text: "1e6" as 1.0e+6. Empty if
/// the value is none.
std::string exponentHint(const ConfigValue& value) {
  static const Pattern number("^([-+]?[0-9]+)([.][0-9]*)?[eE]([-+]?)([0-9]+)$");
  const auto* text = value.as<std::string>();
  if (text == nullptr) return "";
  const std::vector<std::string_view> parts = number.find(*text);
  if (parts.empty()) return "";
  const std::string_view fraction = parts[2].size() > 1 ? parts[2] : ".0";
  const std::string_view sign = parts[3].empty() ? "+" : parts[3];
  return fmt::format("; write {}{}e{}{}, because YAML reads {} as text", parts[1], fraction, sign,
                     parts[4], *text);
}

const ConfigValue::Map* mapOrIssue(const ConfigValue& value, const std::string& name,
                                   std::vector<ConfigIssue>& issues) {
  const auto* map = value.as<ConfigValue::Map>();
  if (map == nullptr)
    issues.push_back({name, fmt::format("is {}, but must be a map", shownWithType(value))});
  return map;
}

}  // namespace

bool Range::holds(double number) const {
  return (min_excluded ? number > min : number >= min) && number <= max;
}

ConfigReader::ConfigReader(const ConfigValue& value, std::string name,
                           std::vector<ConfigIssue>& issues)
    : name_(std::move(name)), map_(mapOrIssue(value, name_, issues)), issues_(issues) {}

ConfigReader::ConfigReader(const ConfigValue::Map* map, std::string name,
                           std::vector<ConfigIssue>& issues)
    : name_(std::move(name)), map_(map), issues_(issues) {}

bool ConfigReader::has(const std::string& key) const {
  return map_ != nullptr && map_->count(key) > 0;
}

std::vector<std::string> ConfigReader::keys() const {
  std::vector<std::string> keys;
  if (map_ == nullptr) return keys;
  for (const auto& entry : *map_) keys.push_back(entry.first);
  return keys;
}

const ConfigValue& ConfigReader::value(const std::string& key) const {
  static const ConfigValue nothing;
  return has(key) ? map_->at(key) : nothing;
}

std::string ConfigReader::shown(const std::string& key) const { return value(key).shown(); }

std::string ConfigReader::fullName(const std::string& key) const {
  return key.empty() ? name_ : name_ + "/" + printable(key);
}

double ConfigReader::number(const std::string& key, const Range& range,
                            std::optional<double> fallback) {
  const auto presence = fallback ? Presence::kOptional : Presence::kRequired;
  return findNumber(key, range, presence).value_or(fallback.value_or(0.0));
}

int ConfigReader::integer(const std::string& key, int min, int max, std::optional<int> fallback) {
  const auto presence = fallback ? Presence::kOptional : Presence::kRequired;
  return findInteger(key, min, max, presence).value_or(fallback.value_or(0));
}

bool ConfigReader::boolean(const std::string& key, std::optional<bool> fallback) {
  const auto presence = fallback ? Presence::kOptional : Presence::kRequired;
  return findBoolean(key, presence).value_or(fallback.value_or(false));
}

std::string ConfigReader::text(const std::string& key, const std::optional<std::string>& fallback) {
  const auto presence = fallback ? Presence::kOptional : Presence::kRequired;
  return findText(key, presence).value_or(fallback.value_or(""));
}

std::string ConfigReader::oneOf(const std::string& key, const std::vector<std::string>& allowed,
                                const std::optional<std::string>& fallback) {
  const auto presence = fallback ? Presence::kOptional : Presence::kRequired;
  return findOneOf(key, allowed, presence).value_or(fallback.value_or(""));
}

std::optional<double> ConfigReader::findNumber(const std::string& key, const Range& range,
                                               Presence presence) {
  const std::string wanted = wantedText("a number", range);
  const ConfigValue* value = find(key, presence, wanted);
  if (value == nullptr) return {};
  const int* integer = value->as<int>();
  const double* real = value->as<double>();
  if (integer == nullptr && real == nullptr) {
    wrong(key, shownWithType(*value), wanted + exponentHint(*value));
    return {};
  }
  const double number = integer != nullptr ? *integer : *real;
  if (!std::isfinite(number)) {
    wrong(key, value->shown(), wantedText("a finite number", range));
    return {};
  }
  if (!range.holds(number)) {
    wrong(key, value->shown(), boundsText(range));
    return {};
  }
  return number;
}

std::optional<int> ConfigReader::findInteger(const std::string& key, int min, int max,
                                             Presence presence) {
  Range range;
  if (min > std::numeric_limits<int>::min()) range.min = min;
  if (max < std::numeric_limits<int>::max()) range.max = max;
  const std::string wanted = wantedText("an integer", range);
  const ConfigValue* value = find(key, presence, wanted);
  if (value == nullptr) return {};
  const int* integer = value->as<int>();
  if (integer == nullptr) {
    wrong(key, shownWithType(*value), wanted);
    return {};
  }
  if (!range.holds(*integer)) {
    wrong(key, value->shown(), boundsText(range));
    return {};
  }
  return *integer;
}

std::optional<int> ConfigReader::findOneOf(const std::string& key, const std::vector<int>& allowed,
                                           Presence presence, const std::string& hint) {
  std::vector<std::string> words;
  words.reserve(allowed.size());
  for (const int one : allowed) words.push_back(std::to_string(one));
  const std::string wanted = listText(words) + hint;
  const ConfigValue* value = find(key, presence, wanted);
  if (value == nullptr) return {};
  const int* integer = value->as<int>();
  if (integer == nullptr) {
    wrong(key, shownWithType(*value), "an integer: " + wanted);
    return {};
  }
  if (std::find(allowed.begin(), allowed.end(), *integer) == allowed.end()) {
    wrong(key, value->shown(), wanted);
    return {};
  }
  return *integer;
}

std::optional<bool> ConfigReader::findBoolean(const std::string& key, Presence presence) {
  const ConfigValue* value = find(key, presence, "true or false");
  if (value == nullptr) return {};
  const bool* flag = value->as<bool>();
  if (flag != nullptr) return *flag;
  wrong(key, shownWithType(*value), "true or false");
  return {};
}

std::optional<std::string> ConfigReader::findText(const std::string& key, Presence presence,
                                                  const std::string& wanted) {
  const ConfigValue* value = find(key, presence, wanted);
  if (value == nullptr) return {};
  const auto* text = value->as<std::string>();
  if (text == nullptr) {
    wrong(key, shownWithType(*value), wanted);
    return {};
  }
  if (!isPrintable(*text)) {
    wrong(key, value->shown(), "a text without line breaks and other control characters");
    return {};
  }
  return *text;
}

std::optional<std::string> ConfigReader::findOneOf(const std::string& key,
                                                   const std::vector<std::string>& allowed,
                                                   Presence presence) {
  const std::string wanted = listText(allowed);
  auto text = findText(key, presence, wanted);
  if (!text || std::find(allowed.begin(), allowed.end(), *text) != allowed.end()) return text;
  const std::string* meant = nearest(*text, allowed);
  wrong(key, shown(key), meant ? fmt::format("{}; did you mean {}?", wanted, *meant) : wanted);
  return {};
}

ConfigReader ConfigReader::map(const std::string& key) {
  const ConfigValue* value = find(key, Presence::kOptional, "a map");
  const std::string name = fullName(key);
  if (value != nullptr) return {mapOrIssue(*value, name, issues_), name, issues_};
  return {map_ != nullptr ? &kEmptyMap : nullptr, name, issues_};
}

void ConfigReader::issue(const std::string& key, const std::string& message) {
  issues_.push_back({fullName(key), message});
}

void ConfigReader::contradiction(const std::string& key, const std::string& message) {
  issues_.push_back({fullName(key), message, true});
}

void ConfigReader::allow(const std::string& key) { known_.insert(key); }

void ConfigReader::rejectUnknown() {
  if (map_ == nullptr) return;
  const std::vector<std::string> all = known();
  const std::string list = all.empty() ? "is not known; nothing is allowed here"
                                       : "is not known; known here: " + listText(all, "and");
  bool is_listed = false;
  for (const auto& entry : *map_) {
    const std::string& key = entry.first;
    if (known_.count(key) > 0) continue;
    if (const std::string* meant = nearest(key, all)) {
      contradiction(key, fmt::format("is not known; did you mean {}?", *meant));
      continue;
    }
    contradiction(key, is_listed ? "is not known either" : list);
    is_listed = true;
  }
}

const ConfigValue* ConfigReader::find(const std::string& key, Presence presence,
                                      const std::string& wanted) {
  known_.insert(key);
  if (map_ == nullptr) return nullptr;
  const auto found = map_->find(key);
  if (found != map_->end()) return &found->second;
  if (presence == Presence::kRequired) issue(key, "is missing; it must be " + wanted);
  return nullptr;
}

void ConfigReader::wrong(const std::string& key, const std::string& is, const std::string& wanted) {
  issue(key, fmt::format("is {}, but must be {}", is, wanted));
}

}  // namespace stepdriver::config
