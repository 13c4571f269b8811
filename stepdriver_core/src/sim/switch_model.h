#pragma once

#include <cstdint>
#include <optional>

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
  void stick(std::optional<bool> active) { stuck_ = active; }

  /// The reading of its line.
  bool active(std::int64_t time_ns) const;

  /// The reading of its line after the bounces.
  bool settled() const { return stuck_.value_or(pressed_); }

  /// The level of its line.
  bool level(std::int64_t time_ns) const { return active(time_ns) == spec_.active_level; }

  /// @return when the contact bounces next, after this time; kNever when it has settled.
  std::int64_t nextBounce(std::int64_t time_ns) const;

 private:
  bool isPressedAt(double carriage) const;

  SwitchSpec spec_;
  double outward_;  // -1 for a min switch: both kinds are pressed from a position on outwards
  std::int64_t bounce_edges_;
  bool pressed_ = false;
  std::int64_t changed_ns_ = kForEver;
  std::optional<bool> stuck_;
};

}  // namespace stepdriver::sim
