#pragma once

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace stepdriver::test {

inline std::string readText(const std::string& path) {
  std::ifstream file(path);
  std::string text;
  std::getline(file, text);
  if (!file) throw std::runtime_error("can't read " + path + ": " + std::strerror(errno));
  return text;
}

inline void writeText(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text << std::flush;
  if (!file) {
    throw std::runtime_error("can't write \"" + text + "\" to " + path + ": " +
                             std::strerror(errno));
  }
}

/// The lines of a chip of the kernel's gpio-sim, seen from the devices that are wired to them.
class GpioSimLines {
 public:
  static constexpr const char* kFolder = "/sys/kernel/config/gpio-sim";

  GpioSimLines() = default;

  /// @param device of an existing chip: its name in configfs.
  explicit GpioSimLines(const std::string& device) {
    const std::string folder = std::string(kFolder) + "/" + device;
    name_ = readText(folder + "/bank0/chip_name");
    label_ = readText(folder + "/bank0/label");
    lines_ = "/sys/devices/platform/" + readText(folder + "/dev_name") + "/" + name_ + "/sim_gpio";
  }

  const std::string& name() const { return name_; }
  const std::string& label() const { return label_; }

  /// The level of a line, whoever drives it.
  bool level(unsigned offset) const {
    return readText(lines_ + std::to_string(offset) + "/value") == "1";
  }

  /// Drives an input from outside.
  void drive(unsigned offset, bool level) const {
    writeText(lines_ + std::to_string(offset) + "/pull", level ? "pull-up" : "pull-down");
  }

 private:
  std::string name_;
  std::string label_;
  std::string lines_;
};

/// A chip of the kernel's gpio-sim, which exists as long as this object. Needs root and configfs.
class GpioSimChip {
 public:
  using Names = std::vector<std::pair<unsigned, std::string>>;

  /// @param device its name in configfs.
  /// @param names of lines, by offset.
  GpioSimChip(const std::string& device, const std::string& label, unsigned lines,
              const Names& names = {})
      : folder_(std::string(GpioSimLines::kFolder) + "/" + device) {
    const std::string bank = folder_ + "/bank0";
    make(folder_);
    make(bank);
    writeText(bank + "/label", label);
    writeText(bank + "/num_lines", std::to_string(lines));
    for (const auto& [offset, name] : names) {
      make(bank + "/line" + std::to_string(offset));
      writeText(bank + "/line" + std::to_string(offset) + "/name", name);
    }
    writeText(folder_ + "/live", "1");
    lines_ = GpioSimLines(device);
  }
  GpioSimChip(const GpioSimChip&) = delete;
  GpioSimChip& operator=(const GpioSimChip&) = delete;
  ~GpioSimChip() {
    if (there_) std::ofstream(folder_ + "/live") << "0" << std::flush;
    std::error_code ignored;
    for (; !made_.empty(); made_.pop_back()) std::filesystem::remove(made_.back(), ignored);
  }

  const GpioSimLines& lines() const { return lines_; }
  const std::string& name() const { return lines_.name(); }
  const std::string& label() const { return lines_.label(); }
  bool level(unsigned offset) const { return lines_.level(offset); }
  void drive(unsigned offset, bool level) const { lines_.drive(offset, level); }

  /// Removes the chip for good, like a cable that is pulled out.
  void unplug() {
    writeText(folder_ + "/live", "0");
    there_ = false;
  }

 private:
  void make(const std::string& folder) {
    std::filesystem::create_directory(folder);
    made_.push_back(folder);
  }

  std::string folder_;
  GpioSimLines lines_;
  std::vector<std::string> made_;
  bool there_ = true;
};

}  // namespace stepdriver::test
