#include "configuration_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>

#include "stepdriver_core/error.h"
#include "stepdriver_core/yaml.h"

namespace stepdriver::console {
namespace {

Error failure(const std::string& path, const std::string& what) {
  return Error(fmt::format("{} can't be {}: {}", path, what, std::strerror(errno)));
}

using Map = config::ConfigValue::Map;

const config::ConfigValue* valueAt(const config::ConfigValue& tree,
                                   const std::vector<std::string>& path) {
  const config::ConfigValue* value = &tree;
  for (const std::string& key : path) {
    const Map* const map = value->as<Map>();
    const auto found = map == nullptr ? Map::const_iterator() : map->find(key);
    if (map == nullptr || found == map->end()) return nullptr;
    value = &found->second;
  }
  return value;
}

/// "axes/x/steps_per_mm is 100.0 in the file, but 80.0 in the driver"; empty: they are the same.
std::string firstDifference(const config::ConfigValue* file, const config::ConfigValue* driver,
                            const std::string& key) {
  const auto shown = [](const config::ConfigValue* value) {
    return value == nullptr ? std::string("missing") : value->shown();
  };
  const bool both = file != nullptr && driver != nullptr;
  if (both && yaml::textOf(*file) == yaml::textOf(*driver)) return {};
  const Map* const one = both ? file->as<Map>() : nullptr;
  const Map* const other = both ? driver->as<Map>() : nullptr;
  if (one == nullptr || other == nullptr) {
    return fmt::format("{} is {} in the file, but {} in the driver", key, shown(file),
                       shown(driver));
  }
  Map keys = *one;
  keys.insert(other->begin(), other->end());
  for (const auto& [name, unused] : keys) {
    std::string found = firstDifference(valueAt(*file, {name}), valueAt(*driver, {name}),
                                        fmt::format("{}/{}", key, name));
    if (!found.empty()) return found;
  }
  return {};
}

}  // namespace

std::string configurationText(const config::ConfigValue& parameters,
                              const std::vector<std::string>& comment) {
  std::string text;
  for (const std::string& line : comment) text += line.empty() ? "#\n" : "# " + line + "\n";
  return text + yaml::textOf(parameters);
}

std::string readOwnFile(const std::string& path, const config::ConfigValue& parameters,
                        const std::vector<std::string>& axes) {
  const config::ConfigValue file = yaml::load(path);
  for (const std::string& axis : axes) {
    const std::string key = firstDifference(valueAt(file, {"axes", axis}),
                                            valueAt(parameters, {"axes", axis}), "axes/" + axis);
    if (key.empty()) continue;
    throw Error(
        fmt::format("{} isn't the configuration of the running driver: {}. Start the driver "
                    "with this file first, or leave out --config",
                    path, key));
  }
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void checkNewFile(const std::string& path, bool replace) {
  std::error_code unknown;
  if (replace || !std::filesystem::exists(path, unknown)) return;
  throw Error(path + " exists already: --overwrite replaces it, --output chooses another name");
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
  // A link fails if another program has made the file meanwhile; a rename would replace it.
  const bool named = replace ? std::rename(unfinished.c_str(), path.c_str()) == 0
                             : link(unfinished.c_str(), path.c_str()) == 0;
  const Error error = named ? Error("") : failure(path, "written");
  unlink(unfinished.c_str());
  if (!named) throw error;
}

}  // namespace stepdriver::console
