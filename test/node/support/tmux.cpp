#include "support/tmux.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <array>
#include <cstdio>

namespace stepdriver::node_test {
namespace {

std::string quoted(const std::string& text) {
  std::string shell = "'";
  for (const char c : text) shell += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return shell + "'";
}

// Each server has a socket of its own: the one before it may still be ending.
std::string socketName() {
  static int servers = 0;
  return "stepdriver_" + std::to_string(getpid()) + "_" + std::to_string(++servers);
}

}  // namespace

bool Tmux::possible() {
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY);
  if (terminal < 0) return false;
  const char* name = ptsname(terminal);
  const bool there = name != nullptr && access(name, F_OK) == 0;
  close(terminal);
  return there;
}

// tmux starts in a UTF-8 locale only. The shell ends by itself in case a crashed test can't end it.
Tmux::Tmux(int columns, int rows)
    : command_("LC_ALL=C.UTF-8 tmux -L " + socketName() + " -f /dev/null ") {
  if (!there_) return;  // the test is skipped
  run("new-session -d -x " + std::to_string(columns) + " -y " + std::to_string(rows) +
      " 'timeout --foreground 300 env PS1=\"shell> \" sh'");
  waitFor("shell>");
}

Tmux::~Tmux() {
  if (there_) run("kill-server");
}

void Tmux::press(const std::string& key) const { run("send-keys -- " + quoted(key)); }

void Tmux::type(const std::string& line) const {
  run("send-keys -l -- " + quoted(line));
  press("Enter");
}

void Tmux::resize(int columns, int rows) const {
  run("resize-window -x " + std::to_string(columns) + " -y " + std::to_string(rows));
}

std::string Tmux::screen() const { return run("capture-pane -p"); }

bool Tmux::waitFor(const std::string& words) const {
  const bool there = waitUntil([&] { return shows(words); });
  EXPECT_TRUE(there) << "\"" << words << "\" isn't on\n" << screen();
  return there;
}

bool Tmux::waitUntilGone(const std::string& words) const {
  const bool gone = waitUntil([&] { return !shows(words); });
  EXPECT_TRUE(gone) << "\"" << words << "\" is still on\n" << screen();
  return gone;
}

std::string Tmux::run(const std::string& arguments) const {
  std::FILE* const output = popen((command_ + arguments + " 2>&1").c_str(), "r");
  if (output == nullptr) return {};
  std::string text;
  std::array<char, 4096> buffer{};
  std::size_t size = 0;
  while ((size = std::fread(buffer.data(), 1, buffer.size(), output)) > 0) {
    text.append(buffer.data(), size);
  }
  const int status = pclose(output);
  EXPECT_EQ(status, 0) << "tmux " << arguments << ": " << text;
  return text;
}

}  // namespace stepdriver::node_test
