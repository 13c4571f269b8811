#include "configuration_file.h"

#include <fcntl.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "../../check/yaml_scalar.h"
#include "stepdriver_core/error.h"

namespace stepdriver::console {
namespace {

using axis::ConfigValue;

/// Whether a plain scalar of this text is this text: `on` and 017 aren't.
bool isPlain(const std::string& text) {
  try {
    const ConfigValue value = check::resolveScalar(text);
    const std::string* const read = value.as<std::string>();
    return read != nullptr && *read == text;
  } catch (const Error&) {
    return false;
  }
}

/// As short as it can be read back as the same, and always with a point: without it YAML 1.1 has no
/// doubles.
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

Error failure(const std::string& path, const std::string& what) {
  return Error(path + " can't be " + what + ": " + std::strerror(errno));
}

}  // namespace

std::string configurationText(const ConfigValue& parameters,
                              const std::vector<std::string>& comment) {
  std::string text;
  for (const std::string& line : comment) text += line.empty() ? "#\n" : "# " + line + "\n";
  YAML::Emitter emitter;
  emit(emitter, parameters);
  return text + emitter.c_str() + "\n";
}

void checkNewFile(const std::string& path, bool replace) {
  std::error_code unknown;
  if (replace || !std::filesystem::exists(path, unknown)) return;
  throw Error(path + " is there already: --overwrite replaces it, --output takes another name");
}

void writeFile(const std::string& path, const std::string& text, bool replace) {
  checkNewFile(path, replace);
  const std::string unfinished = path + ".new";
  const int file = open(unfinished.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) throw failure(unfinished, "written");
  const bool written = write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
                       fsync(file) == 0;
  if (!written) {
    const Error error = failure(unfinished, "written");
    close(file);
    unlink(unfinished.c_str());
    throw error;
  }
  close(file);
  // A link fails where another one has made the file meanwhile; a rename would replace it.
  const bool named = replace ? std::rename(unfinished.c_str(), path.c_str()) == 0
                             : link(unfinished.c_str(), path.c_str()) == 0;
  const Error error = named ? Error("") : failure(path, "written");
  unlink(unfinished.c_str());
  if (!named) throw error;
}

}  // namespace stepdriver::console
