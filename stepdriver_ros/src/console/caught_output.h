#pragma once

#include <string>
#include <vector>

namespace stepdriver::console {

/// Catches everything that the process prints to standard output and error during the lifetime of
/// this object. Output that isn't read in time is lost, and printing never waits.
class CaughtOutput {
 public:
  /// @throw Error if no pipe can be created.
  CaughtOutput();
  ~CaughtOutput();
  CaughtOutput(const CaughtOutput&) = delete;
  CaughtOutput& operator=(const CaughtOutput&) = delete;

  /// The previous standard output; this object keeps owning it.
  int realOutput() const { return output_; }
  /// Whole lines since the last call, without colours.
  std::vector<std::string> lines();

 private:
  int pipe_ = -1;
  int output_ = -1;
  int error_ = -1;
  std::string partial_;
};

}  // namespace stepdriver::console
