#include "open_chips.h"

#include <algorithm>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

namespace stepdriver::gpio::gpiod {
namespace {

constexpr const char* kFolder = "/dev/";

std::vector<std::string> chipFiles() {
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator file(kFolder, error), end; !error && file != end;
       file.increment(error)) {
    const std::string name = file->path().filename().string();
    std::error_code unknown;
    if (name.rfind("gpiochip", 0) == 0 && !file->is_symlink(unknown)) names.push_back(name);
  }
  std::sort(names.begin(), names.end(), [](const std::string& one, const std::string& other) {
    return one.size() != other.size() ? one.size() < other.size() : one < other;
  });
  return names;
}

}  // namespace

OpenChips openChips() {
  OpenChips open;
  for (const std::string& name : chipFiles()) {
    std::unique_ptr<Chip> chip;
    ChipInfo info;
    try {
      chip = openChip(kFolder + name);
      info = chip->info();
    } catch (const std::system_error& error) {
      chip.reset();
      info.name = name;
      info.error = error.code().value();
    }
    open.table.push_back(std::move(info));
    open.chips.push_back(std::move(chip));
  }
  return open;
}

}  // namespace stepdriver::gpio::gpiod
