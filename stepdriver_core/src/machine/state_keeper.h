#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "machine/state_file.h"

namespace stepdriver::machine {

/// Keeps the positions of a machine's axes in a file: gives them back at the start, and writes them
/// when they have changed and the axes rest. While it keeps them the file says that the machine
/// runs: what a crash leaves is known for that. Disks are slow, so it has a thread of its own.
class StateKeeper {
 public:
  /// Of the axes at rest, by name.
  using Memories = std::map<std::string, axis::AxisMemory>;

  /// What an earlier run has kept.
  struct Loaded {
    KeptState state;       ///< empty if there is none
    std::string why_none;  ///< why an axis has no position in it
  };

  /// @throw Error if the file can't be had.
  explicit StateKeeper(const std::string& path) : file_(path) {}
  ~StateKeeper();
  StateKeeper(const StateKeeper&) = delete;
  StateKeeper& operator=(const StateKeeper&) = delete;

  Loaded load();

  /// Takes the file as one of a machine that runs.
  /// @param read what there is to keep; called from any thread.
  /// @param threaded else keep() is for whoever has the machine. @throw Error
  void start(std::function<Memories()> read, bool threaded);

  /// Writes what has changed, of axes at rest.
  void keep();

  /// The machine is at rest, and stays so.
  void close(const Memories& last);

  /// Why the last writing failed; empty: it didn't.
  std::string error() const;

 private:
  void run();
  bool take(const Memories& memories);
  void save();

  StateFile file_;
  std::function<Memories()> read_;
  mutable std::mutex mutex_;
  KeptState state_;
  bool saved_ = false;
  std::string error_;
  std::condition_variable wake_;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace stepdriver::machine
