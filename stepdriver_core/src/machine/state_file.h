#pragma once

#include <map>
#include <optional>
#include <string>

#include "axis/axis_memory.h"

namespace stepdriver::machine {

/// What a state file keeps.
struct KeptState {
  bool clean = false;  ///< the machine was shut down at rest; else it runs, or has crashed
  std::map<std::string, axis::AxisMemory> axes;  ///< by their names
};

/// A file in which the positions of axes outlast the program: a line of text for each axis.
///
/// It is replaced as a whole: whoever reads it, be it after a loss of power, finds what was saved
/// last or what was saved before that. For one thread at a time.
class StateFile {
 public:
  /// Takes the file for this program, by a lock on `path`.lock, which remains.
  ///
  /// @param path absolute; its directory is there.
  /// @throw Error where another program has it, or the directory can't be written.
  explicit StateFile(std::string path);
  ~StateFile();
  StateFile(const StateFile&) = delete;
  StateFile& operator=(const StateFile&) = delete;

  /// @return none where there is no file. @throw Error where it isn't one of these.
  std::optional<KeptState> load() const;

  /// Returns when the disk has it. @throw Error
  void save(const KeptState& state) const;

  /// Of the file itself, not of its lock.
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  int lock_ = -1;
};

}  // namespace stepdriver::machine
