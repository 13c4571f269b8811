#include "port/klipper/tty_link.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <string>

#include "port/klipper/dictionary.h"

namespace stepdriver::klipper {
namespace {

std::string refusalOfPort(const std::string& path, int baud = 250'000) {
  try {
    const TtyLink link("mcu", path, baud);
  } catch (const BoardError& error) {
    return error.what();
  }
  return "";
}

TEST(TtyLink, SaysWhyAPortCannotBeUsed) {
  EXPECT_NE(refusalOfPort("/nonexistent/port").find("there is no such port"), std::string::npos);
  EXPECT_NE(refusalOfPort("/dev/null").find("it is no serial port"), std::string::npos);
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  ASSERT_EQ(grantpt(terminal), 0);
  ASSERT_EQ(unlockpt(terminal), 0);
  const std::string port = ptsname(terminal);
  {
    const TtyLink first("mcu", port, 250'000);
    const std::string text = refusalOfPort(port);
    EXPECT_NE(text.find("another program uses it"), std::string::npos) << text;
    EXPECT_NE(text.find(port), std::string::npos) << text;
  }
  close(terminal);
}

}  // namespace
}  // namespace stepdriver::klipper
