#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "machine/state_file.h"

namespace stepdriver::machine {

/// Keeps the positions of a machine's axes in a file: restores them at the start, and writes them
/// when they have changed and the axes are at rest. Meanwhile the file says that the machine is
/// running, which identifies the file of a crashed one. Disks are slow, so it has a thread of its
/// own.
class StateKeeper {
 public:
  /// Of the axes, by name.
  using Memories = std::map<std::string, axis::AxisMemory>;

  /// The state of an earlier run.
  struct Loaded {
    KeptState state;       ///< empty if there is none
    std::string why_none;  ///< why it has no position for an axis
    std::string source;    ///< names the file, for messages
  };

  /// @throw Error if the file can't be reserved.
  explicit StateKeeper(const std::string& path) : file_(path) {}
  ~StateKeeper();
  StateKeeper(const StateKeeper&) = delete;
  StateKeeper& operator=(const StateKeeper&) = delete;

  Loaded load();

  /// Marks the file as that of a running machine.
  /// @param read returns the state to keep; called from any thread.
  /// @param threaded false: the owner of the machine calls keep(). @throw Error
  void start(std::function<Memories()> read, bool threaded);

  /// Writes changes. @return whether there were any.
  bool keep();

  /// A motion begins: the file will soon say so. Returns at once, from any thread.
  void noteMotion() noexcept;

  /// The machine is at rest, and stays so.
  void close(const Memories& last);

  /// Why the last write failed; empty: it succeeded. Doesn't wait for the disk.
  std::string error() const;

 private:
  void run();
  bool merge(const Memories& memories);
  void save();

  StateFile file_;
  std::function<Memories()> read_;
  mutable std::mutex mutex_;
  KeptState state_;
  bool saved_ = false;
  mutable std::mutex error_mutex_;  // never held while the disk writes
  std::string error_;
  std::condition_variable wake_;
  bool ended_ = false;
  std::atomic<bool> motion_begins_{false};
  std::thread thread_;
};

}  // namespace stepdriver::machine
