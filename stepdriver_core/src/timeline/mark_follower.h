#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "profile/marks.h"
#include "profile/shaped_axes.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// What an output does next along a path, and when: the motion along the path that is followed,
/// those that take over, and the next mark. A mark comes once: motions along the same path, or a
/// longer one, only change its time. All times are motion times. For the pulse thread.
class MarkFollower {
 public:
  /// A motion along a path, and the marks of one output on it. Both outlive the follower's reading.
  struct Entry {
    const motion::Profile* along = nullptr;
    const motion::OutputMarks* marks = nullptr;
    /// nullptr: the axes are where the motion along the path is. Otherwise it outlives the
    /// following, too.
    const motion::ShapedAxes* axes = nullptr;
    std::uint64_t serial = 0;

    Nanoseconds start() const { return along->startNs(); }
  };

  bool follows() const { return current_.along != nullptr; }
  /// Serial of the oldest entry that is still read; 0: none is.
  std::uint64_t reads() const { return follows() ? current_.serial : 0; }
  /// Whether there is room for a motion that begins at this time: those that would begin at or
  /// after it are dropped.
  bool hasRoom(Nanoseconds start) const {
    return size_ < kCapacity || successors_[size_ - 1].start() >= start;
  }
  /// Begins a path with its first mark, or adds a motion that takes over. @pre hasRoom() for it
  void follow(const Entry& entry);
  /// Follows nothing any more: no mark is left.
  void end();

  /// When the next mark comes; empty: the motion doesn't reach another one.
  const std::optional<Nanoseconds>& due() const { return due_; }
  /// What the next mark does. @pre it is due at some time
  const OutputSetting& setting() const { return nextMark().setting; }
  /// The next mark has been made.
  void advance();
  /// The number of the next mark: so many were made since the begin of the path.
  std::uint64_t made() const { return made_; }

 private:
  static constexpr std::size_t kCapacity = 16;

  const motion::Mark& nextMark() const {
    return current_.marks->marks[made_ - current_.marks->first];
  }
  void takeOver();
  void find();
  Nanoseconds madeAt(Nanoseconds planned) const;
  const motion::ShapedAxes& axesAt(Nanoseconds time) const;

  Entry current_;
  std::array<Entry, kCapacity> successors_{};
  std::size_t size_ = 0;
  std::size_t piece_ = 0;  // of the motion, before which the next mark isn't
  Nanoseconds began_ = 0;
  std::uint64_t made_ = 0;
  std::optional<Nanoseconds> due_;
};

}  // namespace stepdriver::pulse
