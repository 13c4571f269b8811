#pragma once

#include <map>
#include <optional>
#include <string>

#include "axis/axis_memory.h"

namespace stepdriver::machine {

/// The contents of a state file.
struct KeptState {
  /// True: the machine was shut down at rest; false: it is running, or has crashed.
  bool clean = false;
  std::map<std::string, axis::AxisMemory> axes;  ///< by their names
};

/// A file that keeps the positions of axes beyond the program's end: a line of text for each axis.
///
/// It is replaced as a whole: a reader finds the latest or the previous contents, even after a loss
/// of power. It is a regular file that only its owner can read and write. For one thread at a time.
class StateFile {
 public:
  /// Reserves the file for this program with a lock on `path`.lock, which remains.
  ///
  /// @param path absolute; its directory exists.
  /// @throw Error if another program has reserved it, if it or its lock is a folder, a link, a pipe
  ///   or a device, or if the directory can't be written.
  explicit StateFile(std::string path);
  ~StateFile();
  StateFile(const StateFile&) = delete;
  StateFile& operator=(const StateFile&) = delete;

  /// @return empty if there is no file. @throw Error if it isn't a state file.
  std::optional<KeptState> load() const;

  /// Returns when it is on the disk. @throw Error
  void save(const KeptState& state) const;

  /// The path of the file itself, not that of its lock.
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  int lock_ = -1;
};

}  // namespace stepdriver::machine
