#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "homing_kinds.h"
#include "profile/resting_count.h"

namespace stepdriver::activity {

std::string HomingToBlock::sensor() const {
  if (config_.input.empty()) return axis_.chipText(0);
  return "the input " + config_.input;
}

// That of a fault output is a fault of the driver.
bool HomingToBlock::reports() const {
  const auto& input = axis_.motor.lines().homing_input;
  return input && (axis_.readInput(input->signal.line) != 0) == input->signal.active;
}

void HomingToBlock::start() {
  if (reports()) {
    return failNow(sensor() + " reports a block before the axis has moved");
  }
  approach(axis::HomingPhase::kSeeking);
}

std::string HomingToBlock::unmet() const {
  if (phase() == axis::HomingPhase::kBackingOff) return "it didn't back off";
  return fmt::format("{} didn't report a block{}", sensor(),
                     phase() == axis::HomingPhase::kLatching ? " again" : "");
}

// The second approach meets the block where the first one did. If the first one was ended by
// something else, it doesn't.
void HomingToBlock::approach(axis::HomingPhase phase) {
  enter(phase, towards_);
  const bool again = phase == axis::HomingPhase::kLatching;
  Goal goal;
  goal.target =
      again ? motion::restingCount(trigger_ + towards_ * config_.pull_off * axis_.stepsPerUnit())
            : bound();
  goal.velocity = again ? config_.latch_speed : config_.seek_speed;
  goal.until_block = true;
  begin(std::move(goal));
}

void HomingToBlock::backOff() {
  enter(axis::HomingPhase::kBackingOff, -towards_);
  Goal goal;
  goal.target = motion::restingCount(trigger_ - towards_ * config_.pull_off * axis_.stepsPerUnit());
  goal.velocity = config_.seek_speed;
  begin(std::move(goal));
}

void HomingToBlock::strokeEnded() {
  const bool approaches =
      phase() == axis::HomingPhase::kSeeking || phase() == axis::HomingPhase::kLatching;
  const axis::MoveEnd end = stroke()->result().end;
  if (approaches && axis_.motor.state().end == pulse::EndReason::kBlocked) {
    trigger_ = axis_.exactCount();
    const bool comes_again = phase() == axis::HomingPhase::kSeeking && config_.approaches == 2;
    return comes_again ? backOff() : pullOff(trigger_);
  }
  if (end == axis::MoveEnd::kEndstopMin || end == axis::MoveEnd::kEndstopMax) {
    return failNow(fmt::format("the {} endstop was met while {}",
                               end == axis::MoveEnd::kEndstopMin ? "min" : "max", nameOf(phase())));
  }
  if (approaches) return notBlocked();
  if (phase() == axis::HomingPhase::kBackingOff) {
    if (!reports()) return approach(axis::HomingPhase::kLatching);
    return failNow(
        fmt::format("{} still reports a block {} off it", sensor(), axis_.show(config_.pull_off)));
  }
  succeed(trigger_);
}

void HomingToBlock::notBlocked() {
  if (phase() == axis::HomingPhase::kSeeking) {
    return failNow(unmet() + " within max_travel, " + axis_.show(config_.max_travel));
  }
  failNow(fmt::format("{} within {} of the place of the first one", unmet(),
                      axis_.show(config_.pull_off)));
}

}  // namespace stepdriver::activity
