#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "profile/shaped_profile.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Profiles that take over, one after the other, each at its start time. Each was planned to
/// continue the one before it, so none may be left out.
class Successors {
 public:
  struct Entry {
    motion::ShapedProfile profile;
    std::uint64_t serial = 0;
    bool settles = false;
  };

  bool empty() const { return size_ == 0; }
  const Entry& first() const { return entries_[0]; }
  const Entry& last() const { return entries_[size_ - 1]; }

  /// Whether there is room for a profile that begins at this time: those that would begin at or
  /// after it are dropped.
  bool hasRoom(Nanoseconds start) const {
    return size_ < kCapacity || last().profile.startNs() >= start;
  }

  /// @pre hasRoom() for it.
  void add(const Entry& entry);
  Entry takeFirst();
  void clear() { size_ = 0; }

 private:
  static constexpr std::size_t kCapacity = 16;
  std::array<Entry, kCapacity> entries_{};
  std::size_t size_ = 0;
};

}  // namespace stepdriver::pulse
