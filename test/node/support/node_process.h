#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace stepdriver::node_test {

// The package's nodes, by the full names of their files. The environment variable STEPDRIVER_NODE
// names another build of the node, for example one with a sanitizer.
extern const char* const kStepdriverNode;
extern const char* const kStepdriverJoystick;
extern const char* const kStepdriverBase;

/// A running node, and everything that it prints. If it is still running at the end, it is killed.
class NodeProcess {
 public:
  explicit NodeProcess(const std::vector<std::string>& arguments,
                       const std::string& program = kStepdriverNode);
  ~NodeProcess();
  NodeProcess(const NodeProcess&) = delete;
  NodeProcess& operator=(const NodeProcess&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const;

  /// @return the exit code, or 128 + the signal's number if a signal ended it; no value if it is
  ///   still running after this time.
  std::optional<int> waitForExit(std::chrono::duration<double> bound);

  /// A size from its /proc/PID/status, such as `VmRSS` [kB].
  /// @throw std::runtime_error if it has none.
  std::size_t kilobytes(const std::string& field) const;
  /// How many file descriptors it has open.
  std::size_t descriptors() const;

  /// Both of its streams; complete after waitForExit().
  std::string output();

 private:
  void readOutput(int stream);

  pid_t pid_ = -1;
  std::optional<int> exit_code_;
  std::mutex mutex_;
  std::string output_;
  std::thread reader_;
};

}  // namespace stepdriver::node_test
