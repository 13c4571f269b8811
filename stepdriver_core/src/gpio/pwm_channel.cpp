#include "pwm_channel.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <thread>
#include <vector>

#include "chip_table.h"
#include "message_text.h"
#include "stepdriver_core/error.h"

namespace stepdriver::gpio {
namespace {

namespace fs = std::filesystem;

// udev gives a new channel its permissions a moment after the export.
constexpr int kMostLooks = 100;
constexpr auto kLook = std::chrono::milliseconds(20);

/// @return 0 or errno.
int writeNumber(const char* path, std::int64_t number) noexcept {
  std::array<char, 24> text{};
  char* const end = std::to_chars(text.data(), text.data() + text.size() - 1, number).ptr;
  *end = '\n';
  const auto length = static_cast<std::size_t>(end + 1 - text.data());
  const int file = open(path, O_WRONLY | O_CLOEXEC);
  if (file < 0) return errno;
  const ssize_t written = ::write(file, text.data(), length);
  const int error = written < 0 ? errno : written == static_cast<ssize_t>(length) ? 0 : EIO;
  close(file);
  return error;
}

std::string textIn(const std::string& file) {
  std::ifstream stream(file);
  std::string text;
  std::getline(stream, text);
  return text.empty() ? "nothing" : text;
}

std::string chipFolder(const std::string& folder, const PwmLine& line) {
  return folder + "/pwmchip" + std::to_string(line.chip);
}

std::string chipsIn(const std::string& folder) {
  std::vector<std::string> chips;
  std::error_code unreadable;
  for (const auto& entry : fs::directory_iterator(folder, unreadable)) {
    chips.push_back(entry.path().filename().string());
  }
  std::sort(chips.begin(), chips.end());
  if (chips.empty()) return "there is no PWM chip";
  return "there are " + joinedText(chips, [](const std::string& chip) { return chip; });
}

std::string remedyOf(int error) {
  if (error == EACCES || error == EPERM) {
    return "; run the program as root, or let a udev rule give its group the files of the channel";
  }
  if (error == EBUSY) return "; the kernel or another program has the channel";
  if (error == EINVAL) return "; the chip can't make it: choose another frequency_hz";
  return "";
}

}  // namespace

PwmChannel::PwmChannel(const std::string& folder, const PwmLine& line, bool level)
    : line_(line), chip_folder_(chipFolder(folder, line)), duty_file_(path("duty_cycle")) {
  if (const std::string why = whyMissing(folder, line); !why.empty()) throw GpioError(why);
  exportIt();
  // A period below the length of the pulses that it had is refused.
  if (textIn(path("period")) != "0") set("duty_cycle", 0);
  set("period", line_.period_ns);
  set("duty_cycle", level ? line_.on_ns : line_.off_ns);
  set("enable", 1);
}

int PwmChannel::write(bool level, std::uint16_t part) const noexcept {
  return writeNumber(duty_file_.c_str(), level ? line_.lengthOf(part) : line_.off_ns);
}

std::string PwmChannel::whyMissing(const std::string& folder, const PwmLine& line) {
  const std::string chip = chipFolder(folder, line);
  if (!fs::is_directory(chip)) {
    return fmt::format(
        "Line {}: there is no {} ({}): enable the PWM of the computer, and use the "
        "number of its chip",
        line.name(), chip, chipsIn(folder));
  }
  const std::string channels = textIn(chip + "/npwm");
  int count = 0;
  std::from_chars(channels.data(), channels.data() + channels.size(), count);
  if (line.channel < count) return {};
  return fmt::format("Line {}: {}/npwm reads {}, so the channel must be below that", line.name(),
                     chip, channels);
}

void PwmChannel::exportIt() const {
  const std::string file = chip_folder_ + "/export";
  if (!fs::is_directory(chip_folder_ + "/pwm" + std::to_string(line_.channel))) {
    if (const int error = writeNumber(file.c_str(), line_.channel); error != 0) {
      throw GpioError(fmt::format("Line {}: can't write {} to {}: {}{}", line_.name(),
                                  line_.channel, file, errorText(error), remedyOf(error)));
    }
  }
  for (int i = 0; i < kMostLooks && access(duty_file_.c_str(), W_OK) != 0; ++i) {
    std::this_thread::sleep_for(kLook);
  }
}

void PwmChannel::set(const char* file, std::int64_t value) const {
  const std::string name = path(file);
  const int error = writeNumber(name.c_str(), value);
  if (error == 0) return;
  throw GpioError(fmt::format("Line {}: can't write {} to {}, which reads {}: {}{}", line_.name(),
                              value, name, textIn(name), errorText(error), remedyOf(error)));
}

std::string PwmChannel::path(const char* file) const {
  return chip_folder_ + "/pwm" + std::to_string(line_.channel) + "/" + file;
}

}  // namespace stepdriver::gpio
