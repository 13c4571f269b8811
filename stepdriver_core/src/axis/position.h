#pragma once

#include <optional>
#include <string>
#include <utility>

namespace stepdriver::axis {

/// The position of an axis: the position at count 0, whether it can be trusted, and the remainder
/// of its last move beyond a whole microstep. Only this class changes them.
class Position {
 public:
  /// [unit] The position at count 0.
  double origin() const { return origin_; }
  /// The position can be trusted.
  bool isValid() const { return valid_; }
  bool isHomed() const { return homed_; }
  /// Why the position that was kept over a restart can't be trusted, or why one that is trusted
  /// should not be; empty if there is no such reason.
  const std::string& note() const {
    if (valid_) return warning_;
    return note_;
  }

  /// [unit] The commanded position minus the position of the axis at rest: up to half a microstep
  /// after a move that reached its target, otherwise 0. A relative move counts from the commanded
  /// position, so that rounding errors don't accumulate.
  double remainder() const { return remainder_; }
  /// A motion has reached its target except for this [unit].
  void reached(double remainder) { remainder_ = remainder; }
  /// From now on the commanded position is the position of the axis.
  void dropRemainder() { remainder_ = 0.0; }

  /// Something has happened that makes the position of the axis uncertain.
  void distrust() {
    valid_ = homed_ = false;
    warning_.clear();
    dropRemainder();
  }
  /// Something says that the position is wrong, but the axis goes on.
  void warn(std::string why) { warning_ = std::move(why); }

  /// A caller declares the position of the axis.
  void declare(double origin) {
    origin_ = origin;
    valid_ = true;
    warning_.clear();
    dropRemainder();
  }
  void home(double origin) {
    declare(origin);
    homed_ = true;
  }
  void beginHoming() { homed_ = false; }

  /// The scale of counts has changed; the position is the same.
  void rescale(double origin) { origin_ = origin; }

  /// Restores the position of an earlier run.
  /// @param doubt why it can't be trusted; empty: it can be trusted.
  void restore(double origin, std::string doubt, bool homed) {
    origin_ = origin;
    note_ = std::move(doubt);
    valid_ = note_.empty();
    homed_ = valid_ && homed;
    warning_.clear();
    dropRemainder();
  }
  void setNote(std::string why) { note_ = std::move(why); }

 private:
  double origin_ = 0.0;
  double remainder_ = 0.0;
  bool valid_ = false;
  bool homed_ = false;
  std::string note_;
  std::string warning_;
};

}  // namespace stepdriver::axis
