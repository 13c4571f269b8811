#include "port/klipper/tty_link.h"

#include <gtest/gtest.h>

#include <string>

#include "port/klipper/dictionary.h"
#include "support/board_on_terminal.h"

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
  test::BoardOnTerminal terminal;
  const TtyLink first("mcu", terminal.port, 250'000);
  const std::string text = refusalOfPort(terminal.port);
  EXPECT_NE(text.find("another program uses it"), std::string::npos) << text;
  EXPECT_NE(text.find(terminal.port), std::string::npos) << text;
}

}  // namespace
}  // namespace stepdriver::klipper
