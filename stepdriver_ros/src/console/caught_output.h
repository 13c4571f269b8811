#pragma once

#include <string>
#include <vector>

namespace stepdriver::console {

/// Catches what the process prints to standard output and error, from the making to the end of this
/// object. What nobody takes in time is lost, and nobody who prints ever waits.
class CaughtOutput {
 public:
  /// @throw Error where there is no pipe to be had.
  CaughtOutput();
  ~CaughtOutput();
  CaughtOutput(const CaughtOutput&) = delete;
  CaughtOutput& operator=(const CaughtOutput&) = delete;

  /// What standard output was before; it stays this object's.
  int realOutput() const { return output_; }
  /// Whole lines since the last time, without colours.
  std::vector<std::string> lines();

 private:
  int pipe_ = -1;
  int output_ = -1;
  int error_ = -1;
  std::string partial_;
};

}  // namespace stepdriver::console
