#pragma once

#include <fcntl.h>
#include <linux/gpio.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <stdexcept>
#include <string>

namespace stepdriver::test {

/// A line that another program holds, as the kernel reports it.
class OtherProgram {
 public:
  /// @param chip its name, such as `gpiochip0`.
  /// @param consumer the name that the program gives itself.
  OtherProgram(const std::string& chip, unsigned offset, const std::string& consumer) {
    const int file = open(("/dev/" + chip).c_str(), O_RDWR | O_CLOEXEC);
    gpiohandle_request request{};
    request.lineoffsets[0] = offset;
    request.lines = 1;
    request.flags = GPIOHANDLE_REQUEST_INPUT;
    std::snprintf(request.consumer_label, sizeof request.consumer_label, "%s", consumer.c_str());
    const int result = ioctl(file, GPIO_GET_LINEHANDLE_IOCTL, &request);
    close(file);
    if (result < 0) throw std::runtime_error("the line can't be held");
    line_ = request.fd;
  }
  OtherProgram(const OtherProgram&) = delete;
  OtherProgram& operator=(const OtherProgram&) = delete;
  ~OtherProgram() { close(line_); }

 private:
  int line_;
};

}  // namespace stepdriver::test
