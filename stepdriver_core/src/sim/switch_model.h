#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "sim_time.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {

enum class Side { kMin, kMax };

/// A switch: the position of the carriage presses it or not, and it bounces for a while after each
/// change.
class SwitchModel {
 public:
  SwitchModel(const SwitchSpec& spec, Side side, double carriage);

  const SwitchSpec& spec() const { return spec_; }

  /// The carriage is at this position from this time on.
  void follow(double carriage, std::int64_t time_ns);

  /// Reads active (true) or inactive from now on, whatever the carriage does; empty: works again.
  /// @param until_ns it works again from then on.
  void stick(std::optional<bool> active, std::int64_t until_ns = kNever) {
    stuck_ = active;
    stuck_until_ns_ = until_ns;
  }

  /// The program reads its line.
  void noteRead(std::int64_t time_ns) { read_ = active(time_ns); }
  /// A step of its axis begins. @return whether it should not have, if it goes towards the switch:
  ///   that is active, and the program hasn't read it inactive since the last step. A switch that
  ///   somebody presses between the reading and the step comes too late.
  bool noteStep(std::int64_t time_ns) {
    return std::exchange(read_, std::nullopt).value_or(true) && active(time_ns);
  }

  /// The reading of its line.
  bool active(std::int64_t time_ns) const;

  /// The reading of its line after the bounces.
  bool settled(std::int64_t time_ns) const { return isStuck(time_ns) ? *stuck_ : pressed_; }

  /// The level of its line.
  bool level(std::int64_t time_ns) const { return active(time_ns) == spec_.active_level; }

  /// @return when the contact bounces next, after this time; kNever when it has settled.
  std::int64_t nextBounce(std::int64_t time_ns) const;

 private:
  bool isStuck(std::int64_t time_ns) const { return stuck_ && time_ns < stuck_until_ns_; }
  bool isPressedAt(double carriage) const;

  SwitchSpec spec_;
  double outward_;  // -1 for a min switch: both kinds are pressed from a position on outwards
  std::int64_t bounce_edges_;
  bool pressed_ = false;
  std::int64_t changed_ns_ = kForEver;
  std::optional<bool> read_;  // active at its last reading since the last step
  std::optional<bool> stuck_;
  std::int64_t stuck_until_ns_ = kNever;
};

}  // namespace stepdriver::sim
