#include "motor.h"

#include <cmath>

namespace stepdriver::motor {

Motor::Motor(const config::AxisConfig& config, const MotorLines& lines, int channel)
    : channel_(channel),
      lines_(lines),
      pins_(config, lines),
      power_(config.idle_action, !pins_.hasEnable()),
      brake_(config, lines),
      translator_(config.microsteps) {
  if (pins_.hasEnable()) on_enable_line_ = lines_.enable_line->join();
}

void Motor::take(const pulse::ChannelState& state) {
  state_ = state;
  motions_.take(state);
}

motion::MotionState Motor::stateAt(std::int64_t at) const {
  if (const Motion* motion = motions_.latest()) return motion->profile->stateAt(at);
  const motion::DoubleDouble count = motion::fromInteger(state_.count);
  // A stop on a path ends between two microsteps: the next motion continues from there.
  const Motion* last = motions_.find(state_.ended);
  if (last == nullptr || state_.end != pulse::EndReason::kDone) return {count, 0.0, 0.0};
  const motion::DoubleDouble rest = last->profile->endPosition();
  return {std::abs((rest - count).value()) <= 0.5 ? rest : count, 0.0, 0.0};
}

bool Motor::enableIsHeldByOthers() const {
  return pins_.hasEnable() && lines_.enable_line->isWantedByOthers(on_enable_line_);
}

void Motor::noteEnable(bool wanted) { lines_.enable_line->note(on_enable_line_, wanted); }

bool Motor::takeReleases() {
  if (!pins_.hasEnable() || lines_.enable_line->releases() == releases_seen_) return false;
  releases_seen_ = lines_.enable_line->releases();
  return true;
}

void Motor::pinsRestored() {
  pins_doubtful_ = false;
  mode_failed_ = 0;
}

}  // namespace stepdriver::motor
