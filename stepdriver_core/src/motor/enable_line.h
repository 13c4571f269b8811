#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stepdriver::motor {

/// An ENABLE line and the axes that it energizes: one axis, or several that share it. It is
/// asserted while any of them wants to be enabled.
class EnableLine {
 public:
  /// @return the number of the axis on this line.
  std::size_t join() {
    wanted_.push_back(false);
    return wanted_.size() - 1;
  }

  /// Whether the line stays asserted if this axis releases it.
  bool isWantedByOthers(std::size_t member) const {
    for (std::size_t i = 0; i < wanted_.size(); ++i) {
      if (i != member && wanted_[i]) return true;
    }
    return false;
  }

  /// The line has been written, if that was needed.
  void note(std::size_t member, bool wanted) {
    const bool released = wanted_[member] && !wanted && !isWantedByOthers(member);
    wanted_[member] = wanted;
    if (released) ++releases_;
  }

  /// How often the last axis released the line: from then on nothing held any of the motors.
  std::uint64_t releases() const { return releases_; }

 private:
  std::vector<bool> wanted_;
  std::uint64_t releases_ = 0;
};

}  // namespace stepdriver::motor
