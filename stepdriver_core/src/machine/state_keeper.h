#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/machine/state_file.h"

namespace stepdriver::machine {

/// Keeps the positions of a machine's axes in a file: gives them back at the start, and writes them
/// when they have changed and the axes rest. While it keeps them the file says that the machine
/// runs: what a crash leaves is known for that. Disks are slow, so it has a thread of its own.
class StateKeeper {
 public:
  using Axes = std::vector<std::unique_ptr<axis::Axis>>;

  /// @throw Error where the file can't be had.
  explicit StateKeeper(const std::string& path) : file_(path) {}
  ~StateKeeper();
  StateKeeper(const StateKeeper&) = delete;
  StateKeeper& operator=(const StateKeeper&) = delete;

  /// Gives the axes back what the file has, and takes it as one of a machine that runs.
  /// @param threaded else keep() is for whoever has the machine. @throw Error
  void start(const Axes& axes, bool threaded);

  /// Writes what has changed, of axes at rest.
  void keep();

  /// The machine is at rest, and stays so.
  void close();

  /// Why the last writing failed; empty: it didn't.
  std::string error() const;

 private:
  void run();
  void save();

  StateFile file_;
  const Axes* axes_ = nullptr;
  mutable std::mutex mutex_;
  KeptState state_;
  bool saved_ = false;
  std::string error_;
  std::condition_variable wake_;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace stepdriver::machine
