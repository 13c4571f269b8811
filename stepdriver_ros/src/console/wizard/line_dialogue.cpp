#include "line_dialogue.h"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <sstream>

#include "../wrapped.h"

namespace stepdriver::console {
namespace {

constexpr int kPoll = 20;  // [ms]
constexpr int kColumns = 79;

void print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

}  // namespace

void LineDialogue::say(const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    for (const std::string& row : wrapped(line, kColumns)) print(row + "\n");
  }
}

std::string LineDialogue::ask(const std::string& question) {
  std::string rows;
  for (const std::string& row : wrapped(question, kColumns)) {
    rows += (rows.empty() ? "" : "\n") + row;
  }
  print(rows);
  for (;;) {
    if (auto answer = line()) return *answer;
    meanwhile_();
    pollfd input{STDIN_FILENO, POLLIN, 0};
    poll(&input, 1, kPoll);
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
