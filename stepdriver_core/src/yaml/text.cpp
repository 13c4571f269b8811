#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "scalar.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/yaml.h"

namespace stepdriver::yaml {
namespace {

using config::ConfigValue;

/// Whether a plain scalar with this text is a string with this text: `on` and 017 aren't.
bool isPlain(const std::string& text) {
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
  if (!isPlain(text)) emitter << YAML::DoubleQuoted;
  emitter << text;
}

void emit(YAML::Emitter& emitter, const ConfigValue& value) {
  if (const auto* map = value.as<ConfigValue::Map>()) {
    emitter << YAML::BeginMap;
    for (const auto& [key, below] : *map) {
      emitter << YAML::Key;
      emitText(emitter, key);
      emitter << YAML::Value;
      emit(emitter, below);
    }
    emitter << YAML::EndMap;
  } else if (const auto* list = value.as<ConfigValue::List>()) {
    emitter << YAML::Flow << YAML::BeginSeq;
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
