#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "support/node_process.h"
#include "support/wait.h"

namespace stepdriver::node_test {

struct ProgramEnd {
  int code = -1;
  std::string output;  ///< of both streams
};

/// Runs one of the package's programs, as `rosrun stepdriver NAME` does, to its end.
inline ProgramEnd runProgram(const std::string& name, const std::vector<std::string>& arguments) {
  NodeProcess process(arguments, std::string(STEPDRIVER_PROGRAMS) + "/" + name);
  // Python, matplotlib and a font cache in the making, on a machine that does other things.
  const auto code = process.waitForExit(10 * kBound);
  EXPECT_TRUE(code) << name << " doesn't end";
  return {code.value_or(-1), process.output()};
}

/// A file of a test's own, which is removed before and after it.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& ending)
      : path_(std::filesystem::temp_directory_path() /
              (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + "_" +
               std::to_string(getpid()) + ending)) {
    std::filesystem::remove(path_);
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  std::string path() const { return path_.string(); }
  bool exists() const { return std::filesystem::exists(path_); }
  std::string text() const {
    std::ifstream file(path_);
    return {std::istreambuf_iterator<char>(file), {}};
  }

 private:
  std::filesystem::path path_;
};

}  // namespace stepdriver::node_test
