#include "caught_output.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "pattern.h"
#include "stepdriver_core/error.h"

namespace stepdriver::console {

CaughtOutput::CaughtOutput() {
  std::fflush(stdout);
  std::fflush(stderr);
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0) {
    throw Error(std::string("no pipe: ") + std::strerror(errno));
  }
  pipe_ = ends[0];
  output_ = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0);
  error_ = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0);
  dup2(ends[1], STDOUT_FILENO);
  dup2(ends[1], STDERR_FILENO);
  close(ends[1]);
}

CaughtOutput::~CaughtOutput() {
  std::fflush(stdout);
  std::fflush(stderr);
  dup2(output_, STDOUT_FILENO);
  dup2(error_, STDERR_FILENO);
  close(output_);
  close(error_);
  close(pipe_);
}

std::vector<std::string> CaughtOutput::lines() {
  std::array<char, 4096> buffer{};
  ssize_t size = 0;
  while ((size = read(pipe_, buffer.data(), buffer.size())) > 0) {
    partial_.append(buffer.data(), static_cast<std::size_t>(size));
  }
  static const Pattern colour("\033\\[[0-9;]*m");
  std::vector<std::string> lines;
  for (std::size_t end = 0; (end = partial_.find('\n')) != std::string::npos;) {
    std::string line = partial_.substr(0, end);
    for (auto found = colour.find(line); !found.empty();) {
      const auto from = static_cast<std::size_t>(found[0].data() - line.data());
      line.erase(from, found[0].size());
      found = colour.find(line, from);
    }
    if (!line.empty()) lines.push_back(line);
    partial_.erase(0, end + 1);
  }
  return lines;
}

}  // namespace stepdriver::console
