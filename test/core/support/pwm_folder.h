#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace stepdriver::test {

/// A folder that looks like /sys/class/pwm: a chip with two channels, of which the second one is
/// exported.
class PwmFolder {
 public:
  PwmFolder() {
    char name[] = "/tmp/stepdriver-pwm-XXXXXX";
    root_ = mkdtemp(name);
    std::filesystem::create_directory(root_ / "pwmchip0");
    write("npwm", "2");
    write("export", "");
    addChannel(1);
  }
  PwmFolder(const PwmFolder&) = delete;
  PwmFolder& operator=(const PwmFolder&) = delete;
  ~PwmFolder() { std::filesystem::remove_all(root_); }

  std::string root() const { return root_; }
  std::string path(const std::string& file) const { return root_ / "pwmchip0" / file; }
  void addChannel(int number) const {
    const std::string channel = "pwm" + std::to_string(number);
    std::filesystem::create_directory(path(channel));
    for (const char* const file : {"period", "duty_cycle", "enable"})
      write(channel + "/" + file, "0");
  }
  void write(const std::string& file, const std::string& text) const {
    std::ofstream(path(file)) << text << "\n";
  }
  std::string read(const std::string& file) const {
    std::ifstream stream(path(file));
    std::string text;
    std::getline(stream, text);
    return text;
  }
  /// Writes of the file fail with ENOSPC from now on.
  void fill(const std::string& file) const {
    std::filesystem::remove(path(file));
    std::filesystem::create_symlink("/dev/full", path(file));
  }
  /// It can't be opened for writing.
  void block(const std::string& file) const {
    std::filesystem::remove(path(file));
    std::filesystem::create_directory(path(file));
  }
  void repair(const std::string& file) const {
    std::filesystem::remove(path(file));
    write(file, "0");
  }

 private:
  std::filesystem::path root_;
};

}  // namespace stepdriver::test
