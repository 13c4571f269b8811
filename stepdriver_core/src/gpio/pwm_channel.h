#pragma once

#include <cstdint>
#include <string>

#include "pwm_line.h"

namespace stepdriver::gpio {

/// A channel of a PWM chip of the kernel: its files. Not for the pulse thread.
class PwmChannel {
 public:
  /// Exports it, sets its period and the length of its pulses at a level, and enables it.
  ///
  /// @param folder with the chips: /sys/class/pwm.
  /// @throw GpioError naming the channel, the file, what was written or read, and the remedy.
  PwmChannel(const std::string& folder, const PwmLine& line, bool level);

  /// Why there is no such channel, as a sentence that begins with its name; empty: there is one.
  static std::string whyMissing(const std::string& folder, const PwmLine& line);

  const PwmLine& line() const { return line_; }
  /// @return 0 or errno.
  /// @param part see LineWrite
  int write(bool level, std::uint16_t part) const noexcept;

 private:
  void exportIt() const;
  void set(const char* file, std::int64_t value) const;
  std::string path(const char* file) const;

  const PwmLine line_;
  const std::string chip_folder_;
  const std::string duty_file_;
};

}  // namespace stepdriver::gpio
