#include "configuration_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "stepdriver_core/error.h"
#include "stepdriver_core/yaml.h"

namespace stepdriver::console {
namespace {

Error failure(const std::string& path, const std::string& what) {
  return Error(fmt::format("{} can't be {}: {}", path, what, std::strerror(errno)));
}

}  // namespace

std::string configurationText(const config::ConfigValue& parameters,
                              const std::vector<std::string>& comment) {
  std::string text;
  for (const std::string& line : comment) text += line.empty() ? "#\n" : "# " + line + "\n";
  return text + yaml::textOf(parameters);
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
  // A link fails if another program has made the file meanwhile; a rename would replace it.
  const bool named = replace ? std::rename(unfinished.c_str(), path.c_str()) == 0
                             : link(unfinished.c_str(), path.c_str()) == 0;
  const Error error = named ? Error("") : failure(path, "written");
  unlink(unfinished.c_str());
  if (!named) throw error;
}

}  // namespace stepdriver::console
