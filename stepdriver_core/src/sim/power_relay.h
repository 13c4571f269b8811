#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "sim_time.h"
#include "stepdriver_core/sim/rig.h"
#include "switch_model.h"

namespace stepdriver::sim {

/// The relay that switches the power of all motors. The power is gone at once when its line says
/// so, and comes after its time: an order of writes that relies on it too early or too late shows
/// in both cases.
class PowerRelay {
 public:
  explicit PowerRelay(const MotorPowerSpec& spec) : spec_(spec) {
    if (spec.feedback_line.empty()) return;
    SwitchSpec contact;
    contact.line = spec.feedback_line;
    contact.active_level = spec.feedback_active;
    contact.position = -std::numeric_limits<double>::infinity();
    feedback_.emplace(contact, Side::kMax, 0.0);
    feedback_->stick(false);
  }

  /// The line has this level from now on.
  void set(bool level, std::int64_t time_ns) {
    const bool on = level == spec_.active_level;
    if (on == on_) return;
    on_ = on;
    if (!stuck_) follow(time_ns);
  }
  /// Welded on, or open for another reason; empty: it follows the line.
  void stick(std::optional<bool> on, std::int64_t time_ns) {
    stuck_ = on;
    follow(time_ns);
  }

  /// The time from which the power is there; kNever while it is off.
  std::int64_t comesAt() const { return there_from_ns_; }
  /// The contact of the feedback; nullptr if it isn't wired.
  SwitchModel* feedback() { return feedback_ ? &*feedback_ : nullptr; }

 private:
  void follow(std::int64_t time_ns) {
    there_from_ns_ = stuck_.value_or(on_) ? time_ns + (stuck_ ? 0 : spec_.on_ns) : kNever;
    if (feedback_) feedback_->stick(false, there_from_ns_);
  }

  const MotorPowerSpec spec_;
  bool on_ = false;
  std::optional<bool> stuck_;
  std::int64_t there_from_ns_ = kNever;
  std::optional<SwitchModel> feedback_;
};

}  // namespace stepdriver::sim
