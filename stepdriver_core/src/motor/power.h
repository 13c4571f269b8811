#pragma once

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::motor {

/// Whether a motor has current: what was commanded, and whether the idle timeout has overridden
/// that. The caller that changes this writes the pins.
class Power {
 public:
  /// @param always_enabled ENABLE isn't wired.
  Power(config::IdleAction idle_action, bool always_enabled)
      : idle_action_(idle_action), enabled_(always_enabled) {}

  /// As commanded.
  bool wantsEnabled() const { return enabled_; }
  bool wantsSleep() const { return asleep_; }

  /// The state of the pins.
  bool isEnabled() const {
    return enabled_ && !(idle_ && idle_action_ == config::IdleAction::kDisable);
  }
  bool isAsleep() const { return asleep_ || (idle_ && idle_action_ == config::IdleAction::kSleep); }
  bool isIdle() const { return idle_; }

  void setEnabled(bool enabled) {
    enabled_ = enabled;
    if (!enabled) idle_ = false;
  }
  void setAsleep(bool asleep) {
    asleep_ = asleep;
    idle_ = false;
  }
  void setIdle(bool idle) { idle_ = idle; }

 private:
  config::IdleAction idle_action_;
  bool enabled_;
  bool asleep_ = false;
  bool idle_ = false;
};

}  // namespace stepdriver::motor
