#include "line_dialogue.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <sstream>

#include "../wrapped.h"

namespace stepdriver::console {
namespace {

constexpr int kLinePoll = 20;  // [ms]
constexpr int kColumns = 79;   // if the window doesn't say
constexpr int kFewestColumns = 20;

/// One column less than the window has: a terminal may start a new line after the last one.
int columns() {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kColumns;
  return std::max(size.ws_col - 1, kFewestColumns);
}

void print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

}  // namespace

void LineDialogue::say(const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    for (const std::string& row : wrapped(line, columns())) print(row + "\n");
  }
}

std::string LineDialogue::ask(const std::string& question) {
  // What follows the last word, usually a space, stays between the question and the answer.
  const std::size_t words = question.find_last_not_of(' ') + 1;
  std::string rows;
  for (const std::string& row : wrapped(question.substr(0, words), columns())) {
    rows += (rows.empty() ? "" : "\n") + row;
  }
  print(rows + question.substr(words));
  for (;;) {
    if (auto answer = line()) return *answer;
    meanwhile_();
    pollfd input{STDIN_FILENO, POLLIN, 0};
    poll(&input, 1, kLinePoll);
  }
}

std::optional<std::string> LineDialogue::line() {
  const std::string who = end_requests_.waitFor(std::chrono::milliseconds(0));
  if (!who.empty()) throw Ended("ended by " + who);
  read();
  const std::size_t end = unread_.find('\n');
  if (end == std::string::npos) {
    if (closed_) throw Ended("the input has ended");
    return {};
  }
  std::string line = unread_.substr(0, end);
  unread_.erase(0, end + 1);
  if (!line.empty() && line.back() == '\r') line.pop_back();
  if (line == "q") throw Ended("ended by q");
  return line;
}

std::optional<std::string> LineDialogue::lineOfAHand() {
  if (isatty(STDIN_FILENO) != 0) return line();
  const std::string who = end_requests_.waitFor(std::chrono::milliseconds(0));
  if (!who.empty()) throw Ended("ended by " + who);
  return {};
}

void LineDialogue::read() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  while (!closed_ && poll(&input, 1, 0) > 0) {
    std::array<char, 1024> buffer{};
    const ssize_t size = ::read(STDIN_FILENO, buffer.data(), buffer.size());
    closed_ = size <= 0;
    if (!closed_) unread_.append(buffer.data(), static_cast<std::size_t>(size));
  }
}

}  // namespace stepdriver::console
