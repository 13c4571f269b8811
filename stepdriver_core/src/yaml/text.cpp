#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "printable.h"
#include "scalar.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/yaml.h"

namespace stepdriver::yaml {
namespace {

using config::ConfigValue;

/// Whether a plain scalar with this text is a string with this text: `on` and 017 aren't, a
/// carriage return at its end would belong to the line, --- may begin a document, and the key <<
/// merges maps.
bool isPlain(const std::string& text) {
  if (!isPrintable(text) || text == "<<") return false;
  if (text.rfind("---", 0) == 0 || text.rfind("...", 0) == 0) return false;
  try {
    const ConfigValue value = resolveScalar(text);
    const std::string* const read = value.as<std::string>();
    return read != nullptr && *read == text;
  } catch (const Error&) {
    return false;
  }
}

/// The shortest text that is read back as the same number, always with a decimal point: YAML 1.1
/// requires one in a double.
std::string doubleText(double number) {
  if (std::isnan(number)) return ".nan";
  if (std::isinf(number)) return number > 0.0 ? ".inf" : "-.inf";
  constexpr int kFewest = 6;
  constexpr int kMost = 17;
  char text[64];
  for (int digits = kFewest; digits <= kMost; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, number);
    if (std::strtod(text, nullptr) == number) break;
  }
  std::string shown = text;
  if (shown.find('.') == std::string::npos) {
    shown.insert(std::min(shown.find('e'), shown.size()), ".0");
  }
  return shown;
}

void emitText(YAML::Emitter& emitter, const std::string& text) {
  // This also escapes U+007F, which YAML doesn't allow as it is.
  if (!isPlain(text)) emitter << YAML::DoubleQuoted << YAML::EscapeNonAscii;
  emitter << text;
}

/// yaml-cpp can't write a long key in a list between brackets.
bool holdsOnlyScalars(const ConfigValue::List& list) {
  return std::none_of(list.begin(), list.end(), [](const ConfigValue& item) {
    return item.as<ConfigValue::Map>() != nullptr || item.as<ConfigValue::List>() != nullptr;
  });
}

/// YAML allows a key 1024 characters if nothing marks it as a key. A byte becomes at most four.
constexpr std::size_t kLongestPlainKey = 250;  // bytes

void emit(YAML::Emitter& emitter, const ConfigValue& value) {
  if (const auto* map = value.as<ConfigValue::Map>()) {
    emitter << YAML::BeginMap;
    for (const std::string& key : value.orderedKeys()) {
      if (key.size() > kLongestPlainKey) emitter << YAML::LongKey;
      emitter << YAML::Key;
      emitText(emitter, key);
      emitter << YAML::Value;
      emit(emitter, map->at(key));
    }
    emitter << YAML::EndMap;
  } else if (const auto* list = value.as<ConfigValue::List>()) {
    emitter << (holdsOnlyScalars(*list) ? YAML::Flow : YAML::Block) << YAML::BeginSeq;
    for (const ConfigValue& item : *list) emit(emitter, item);
    emitter << YAML::EndSeq;
  } else if (const auto* text = value.as<std::string>()) {
    emitText(emitter, *text);
  } else if (const auto* number = value.as<double>()) {
    emitter << doubleText(*number);
  } else if (value.isNothing()) {
    emitter << YAML::Null;
  } else {
    emitter << value.shown();
  }
}

}  // namespace

std::string textOf(const ConfigValue& value) {
  YAML::Emitter emitter;
  emit(emitter, value);
  return std::string(emitter.c_str()) + "\n";
}

}  // namespace stepdriver::yaml
