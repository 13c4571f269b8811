#include "stepdriver_core/axis/axis.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "axis_impl.h"
#include "homing.h"
#include "stepdriver_core/error.h"

namespace stepdriver::axis {
namespace {

using Lock = std::lock_guard<std::mutex>;

}  // namespace

Axis::Axis(AxisConfig config, int channel, const AxisLines& axis_lines, gpio::Lines& lines,
           EdgeLog& edges, pulse::PulseDriver& driver, std::mutex& mutex)
    : impl_(std::make_unique<Impl>(std::move(config), channel, axis_lines, lines, edges, driver,
                                   mutex)) {}

Axis::~Axis() = default;

const AxisConfig& Axis::config() const { return impl_->config; }

// ---- motion ----

Move Axis::moveTo(double position, bool relative, double velocity) {
  const Lock lock(impl_->mutex);
  return impl_->checkedMove(position, relative, velocity);
}

Move Axis::moveRounds(double rounds, double velocity) {
  const Lock lock(impl_->mutex);
  if (impl_->config.steps_per_round <= 0.0) {
    impl_->refuse(
        "the steps of a round are not known: configure steps_per_round or full_steps_per_round");
  }
  return impl_->checkedMove(rounds * impl_->config.steps_per_round / impl_->config.steps_per_unit,
                            true, velocity);
}

std::optional<MoveResult> Axis::result(const Move& move) const {
  const Lock lock(impl_->mutex);
  impl_->harvest();
  return impl_->log.result(move.id);
}

MoveResult Axis::wait(const Move& move) {
  std::optional<MoveResult> ended;
  impl_->driver.waitFor([&] {
    ended = result(move);
    return ended.has_value();
  });
  return *ended;
}

void Axis::jog(double velocity) {
  const Lock lock(impl_->mutex);
  impl_->checkedJog(velocity);
}

void Axis::setSpeedOverride(double factor) {
  const Lock lock(impl_->mutex);
  impl_->changeOverride(factor);
}

void Axis::setLimits(const AxisLimits& wanted) {
  const Lock lock(impl_->mutex);
  impl_->changeLimits(wanted);
}

AxisLimits Axis::limits() const {
  const Lock lock(impl_->mutex);
  return impl_->limits_next;
}

void Axis::stop() {
  const Lock lock(impl_->mutex);
  impl_->decelerate("it was stopped");
}

void Axis::stop(const Move& move) {
  const Lock lock(impl_->mutex);
  if (impl_->currentMove() == move.id) impl_->decelerate("it was stopped");
}

void Axis::hold() {
  const Lock lock(impl_->mutex);
  impl_->hold();
}

void Axis::resume() {
  const Lock lock(impl_->mutex);
  impl_->resume();
}

// ---- the chip ----

void Axis::bringUp() {
  const Lock lock(impl_->mutex);
  Impl& axis = *impl_;
  if (const auto sequence = axis.pins.bringUp(); sequence.size > 0) axis.writePins(sequence);
  axis.harvest();
  if (axis.config.enable_on_start && axis.pins.hasEnable() && axis.fault.empty()) {
    axis.writeEnable(true);
    axis.enabled = true;
  }
}

void Axis::enable(bool on) {
  Impl& axis = *impl_;
  std::unique_lock<std::mutex> lock(axis.mutex);
  axis.refuseUnlessOpen();
  if (!axis.pins.hasEnable()) {
    axis.refuse("pins/enable isn't configured: the motor is energized as long as the chip is");
  }
  axis.harvest();
  if (on) {
    if (!axis.fault.empty()) axis.refuse("at fault: " + axis.fault + "; call recover first");
    if (axis.disabling) axis.refuse("busy: it is being disabled");
    axis.wake();
    if (axis.enabled) return;
    axis.writeEnable(true);
    axis.enabled = true;
    return;
  }
  axis.restAndDisable(lock, "it was disabled");
}

void Axis::sleep(bool asleep) {
  const Lock lock(impl_->mutex);
  Impl& axis = *impl_;
  axis.refuseWhileMoving(asleep ? "it is put to sleep" : "it is woken");
  if (!axis.pins.hasSleep()) {
    axis.refuse(axis.chip.has_sleep ? "pins/sleep isn't configured"
                                    : "a " + axis.chip.title + " has no SLEEP pin");
  }
  if (!asleep) axis.wake();
  if (axis.asleep == asleep) return;
  axis.writePins(axis.pins.sleep(asleep));
  if (axis.enabled != axis.isEnabled()) axis.writeEnable(axis.enabled);
  axis.idle = false;
  axis.asleep = asleep;
  axis.noteUnpowered();
  axis.noteHome();
}

void Axis::reset() {
  const Lock lock(impl_->mutex);
  Impl& axis = *impl_;
  axis.refuseWhileMoving("it is reset");
  if (!axis.pins.hasReset()) {
    axis.refuse(axis.chip.has_reset ? "pins/reset isn't configured"
                                    : "a " + axis.chip.title + " has no RESET pin");
  }
  axis.writePins(axis.pins.reset());
  axis.noteUnpowered();
  axis.noteHome();
}

void Axis::setMicrosteps(int microsteps) {
  Impl& axis = *impl_;
  std::unique_lock<std::mutex> lock(axis.mutex);
  axis.refuseMicrosteps(microsteps);
  if (microsteps == axis.microsteps) return;
  const std::int64_t common = axis.nearestCommon(microsteps);
  if (common != axis.harvest().count) {
    if (!axis.config.align_on_microstep_change) {
      axis.refuse("1/" + std::to_string(microsteps) + " has no position at " +
                  axis.show(axis.position()) + "; the nearest that both modes have is " +
                  axis.show(axis.positionOf(axis.jointAt(static_cast<double>(common)))) +
                  ": move there first, or configure align_on_microstep_change");
    }
    axis.refuseUnlessReadyToMove();
    axis.refuseBeyondLimits(axis.positionOf(axis.jointAt(static_cast<double>(common))),
                            "the common position");
    axis.refuseIntoEndstop(common - axis.harvest().count);
    const Move move = axis.moveMotor(common);
    lock.unlock();
    const MoveResult result = wait(move);
    lock.lock();
    if (result.end != MoveEnd::kReached) axis.refuse(result.message);
    axis.refuseMicrosteps(microsteps);
  }
  axis.changeMicrosteps(microsteps);
}

void Axis::setPosition(double position) {
  const Lock lock(impl_->mutex);
  Impl& axis = *impl_;
  axis.refuseWhileMoving("its position is set");
  if (!std::isfinite(position)) axis.refuse("the position must be a finite number");
  axis.refuseBeyondLimits(position, "the position");
  axis.origin = position - static_cast<double>(axis.jointCount()) / axis.stepsPerUnit();
  axis.position_valid = true;
}

// ---- state ----

double Axis::peakRate() const {
  const Lock lock(impl_->mutex);
  const Motion* motion = impl_->underWay();
  return motion != nullptr ? motion->profile->peakSpeed() : 0.0;
}

AxisState Axis::state() const {
  const Lock lock(impl_->mutex);
  Impl& axis = *impl_;
  const pulse::Nanoseconds before = axis.driver.motionNow();
  const pulse::ChannelState channel = axis.harvest();
  const pulse::Nanoseconds after = axis.driver.motionNow();
  AxisState state;
  state.enabled = axis.isEnabled();
  state.asleep = axis.isAsleep();
  state.idle = axis.idle;
  state.moving = channel.following != 0;
  state.held = axis.held.has_value() || (axis.homing != nullptr && axis.homing->isHeld());
  state.homed = axis.homed;
  if (axis.homing != nullptr) state.homing = axis.homing->phase();
  state.position_valid = axis.position_valid;
  state.microsteps = axis.microsteps;
  state.position = axis.positionOf(static_cast<double>(channel.count - channel.slack));
  state.planned = state.position;
  state.target = state.position;
  state.fault = axis.fault;
  if (!axis.fault.empty()) state.remedy = axis.remedy;
  if (!axis.position_valid) state.position_note = axis.position_note;
  if (axis.held && axis.held->goal.target) {
    state.target = axis.positionOf(static_cast<double>(*axis.held->goal.target));
  }
  if (const Motion* motion = axis.log.find(channel.following); motion && state.moving) {
    const motion::MotionState now = motion->profile->stateAt(after);
    const auto [low, high] =
        std::minmax({motion->profile->stateAt(before).position.value(), now.position.value()});
    const double planned = std::clamp(static_cast<double>(channel.count), low, high);
    state.planned = axis.positionOf(planned - static_cast<double>(channel.slack));
    // While the backlash is taken up, the joint stands.
    const bool joint_moves = channel.slack == (now.velocity > 0.0 ? axis.backlash() : 0);
    state.velocity = joint_moves ? now.velocity / axis.stepsPerUnit() : 0.0;
    const Goal& goal = motion->goal;
    if (goal.stops()) {
      state.target = axis.positionOf(axis.jointAt(motion->profile->endPosition().value()));
    } else if (goal.target) {
      state.target = axis.positionOf(static_cast<double>(*goal.target));
    }
    if (goal.target || goal.stops()) {
      const pulse::Nanoseconds left = motion->profile->endNs() - after;
      state.time_left = static_cast<double>(std::max<pulse::Nanoseconds>(left, 0)) * 1e-9;
    }
  }
  return state;
}

EndstopState Axis::endstops() const {
  const Impl& axis = *impl_;
  return {axis.endstopActive(axis.axis_lines.endstop_min, axis.config.endstop_min),
          axis.endstopActive(axis.axis_lines.endstop_max, axis.config.endstop_max)};
}

// ---- the machine's side ----

pulse::Nanoseconds Axis::supervise() {
  const Lock lock(impl_->mutex);
  return impl_->superviseIdle();
}

void Axis::recover() {
  const Lock lock(impl_->mutex);
  Impl& axis = *impl_;
  axis.harvest();
  if (axis.fault.empty()) return;
  axis.restorePins();
  axis.resetFaultyChip();
  if (axis.driver.engine().emergencyStopped()) axis.refuse("an emergency stop has come meanwhile");
  axis.fault.clear();
}

void Axis::noteEmergencyStop() {
  const Lock lock(impl_->mutex);
  Impl& axis = *impl_;
  axis.interruptHoming("emergency stop");
  axis.driver.waitFor([&axis] { return !axis.moving(); });
  axis.latchEmergencyStop(Impl::kEmergencyStop);
  axis.dropHeld(MoveEnd::kEmergencyStop, axis.fault);
}

void Axis::close(const std::string& reason) {
  const Lock lock(impl_->mutex);
  impl_->closed = reason;
  impl_->decelerate(reason);
}

void Axis::shutDown() {
  std::unique_lock<std::mutex> lock(impl_->mutex);
  if (impl_->pins.hasEnable() && impl_->config.disable_on_shutdown) {
    impl_->restAndDisable(lock, impl_->closed);
  } else {
    impl_->awaitRest(lock, impl_->closed);
  }
}

}  // namespace stepdriver::axis
