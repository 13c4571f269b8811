#include "driver_activities.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "stepdriver_core/error.h"

namespace stepdriver::activity {
namespace {

using driver::FaultEnd;

// A changed level is reported within this time, even if its edge was lost.
constexpr pulse::Nanoseconds kLevelIsTold = 250'000'000;

std::unique_ptr<Step> resetStep(Context& context, axis::AxisModel& axis) {
  return pinsStep(context, axis, axis.motor.pins().reset(), [&axis] { axis.noteReset(); });
}

/// Writes registers of the chips that have a serial port, if there are any.
void addSetUp(Context& context, axis::AxisModel& axis, Steps& steps, SetUpChipsStep::Which which,
              SetUpChipsStep::Failed failed) {
  for (std::size_t i = 0; i < axis.motor.chips(); ++i) {
    if (axis.motor.tmcAt(i) == nullptr) continue;
    steps.push_back(std::make_unique<SetUpChipsStep>(context, axis, which, std::move(failed)));
    return;
  }
}

/// Energizes the motor, or switches its current off, until the next such command.
std::unique_ptr<Step> powerStep(Context& context, axis::AxisModel& axis, bool on) {
  return enableStep(context, axis, on, [&axis, on] { axis.motor.power().setEnabled(on); });
}

}  // namespace

// ---- current ----

Steps BringUp::plan() {
  axis::AxisModel& axis = *axes().front();
  Steps steps;
  const bool enables = axis.config.enable_on_start && axis.motor.pins().hasEnable();
  const bool stopped = context().stops_asked != context().stops_handled || axis.fault;
  // A fault of the power doesn't keep the machine from beginning: recover switches it on.
  if ((enables || axis.motor.power().wantsEnabled()) && !stopped &&
      context().motor_power.isWired()) {
    add(steps, std::make_unique<RunStep>([this] { context().motor_power.switchOn(); }));
    add(steps, std::make_unique<WaitStep>(
                   context(), [] { return pulse::kNever; },
                   [this] {
                     const MotorPower& power = context().motor_power;
                     return power.isThere() || !power.isWanted();
                   }));
  }
  if (const auto sequence = axis.motor.pins().bringUp(); sequence.size > 0) {
    add(steps, pinsStep(context(), axis, sequence));
  }
  // Without power they don't answer: they are set up when it comes. A chip that isn't ready is a
  // fault of its axis, and the others can move.
  add(steps, std::make_unique<RunStep>([this, &axis] {
        if (!context().mode.powered) return;
        Steps registers;
        addSetUp(context(), axis, registers, SetUpChipsStep::Which::kAll,
                 [&axis](const std::string& fault, const std::string& remedy) {
                   axis.fault.latch(fault, remedy);
                   axis.distrust();
                 });
        if (!registers.empty()) insert(std::move(registers));
      }));
  add(steps, std::make_unique<RunStep>([this, &axis, enables] {
        if (!enables || axis.fault) return;
        if (context().stops_asked != context().stops_handled) return;
        Steps enabling;
        add(enabling, powerStep(context(), axis, true));
        insert(std::move(enabling));
      }));
  return braked(context(), axis, std::move(steps));
}

Steps Enable::plan() {
  axis::AxisModel& axis = *axes().front();
  refuseUnlessCurrentStays(context(), axis);
  Steps steps = wakeSteps(context(), axis);
  if (!axis.motor.power().wantsEnabled()) {
    append(steps, powerSteps(context(), axis));
    addSetUp(context(), axis, steps, SetUpChipsStep::Which::kNotSetUp,
             [&axis](const std::string& fault, const std::string& remedy) {
               axis.refuse(fault + "; " + remedy);
             });
    Steps enabling;
    add(enabling, powerStep(context(), axis, true));
    append(steps, braked(context(), axis, std::move(enabling)));
  }
  // Its success says that the motor holds the load, whatever came while its pins were written.
  add(steps,
      std::make_unique<RunStep>([this, &axis] { refuseUnlessCurrentStays(context(), axis); }));
  return steps;
}

Steps Disable::plan() {
  axis::AxisModel& axis = *axes().front();
  const motor::Power& power = axis.motor.power();
  Steps steps;
  if (!power.wantsEnabled()) return steps;
  if (power.isEnabled()) add(steps, powerStep(context(), axis, false));
  if (power.wantsSleep() != power.isAsleep()) {
    add(steps, pinsStep(context(), axis, axis.motor.pins().sleep(power.wantsSleep())));
  }
  add(steps, std::make_unique<RunStep>([this, &axis] {
        axis.motor.power().setEnabled(false);
        joined_.clear();
      }));
  return braked(context(), axis, std::move(steps));
}

Steps Sleep::plan() {
  axis::AxisModel& axis = *axes().front();
  if (axis.motor.power().wantsSleep() == asleep_) {
    return asleep_ ? Steps() : wakeSteps(context(), axis);
  }
  Steps steps;
  add(steps, pinsStep(context(), axis, axis.motor.pins().sleep(asleep_)));
  add(steps, std::make_unique<RunStep>([this, &axis] {
        const motor::Power& power = axis.motor.power();
        if (power.wantsEnabled() == power.isEnabled()) return;
        Steps enabling;
        add(enabling, enableStep(context(), axis, power.wantsEnabled(), {}));
        insert(std::move(enabling));
      }));
  add(steps, std::make_unique<RunStep>([this, &axis] {
        axis.motor.power().setAsleep(asleep_);
        axis.noteAsleep();
      }));
  return braked(context(), axis, std::move(steps));
}

Steps Reset::plan() {
  axis::AxisModel& axis = *axes().front();
  Steps steps;
  add(steps, resetStep(context(), axis));
  return braked(context(), axis, std::move(steps));
}

Steps GoIdle::plan() {
  axis::AxisModel& axis = *axes().front();
  Steps steps;
  if (axis.config.idle_action == config::IdleAction::kSleep) {
    add(steps, pinsStep(context(), axis, axis.motor.pins().sleep(true), [&axis] {
          axis.motor.power().setIdle(true);
          axis.noteAsleep();
        }));
  } else if (axis.config.idle_action == config::IdleAction::kLowerCurrent) {
    // The controller writes the register. The motor keeps holding the load.
    add(steps, std::make_unique<RunStep>([&axis] { axis.motor.power().setIdle(true); }));
    return steps;
  } else {
    add(steps, enableStep(context(), axis, false, [&axis] { axis.motor.power().setIdle(true); }));
  }
  return braked(context(), axis, std::move(steps));
}

// ---- faults ----

Steps Recover::plan() {
  axis::AxisModel& axis = *axes().front();
  if (const std::string lost = axis.lostLineText(); !lost.empty()) axis.refuse("at fault: " + lost);
  Steps steps;
  // It stays off for a motor that is to have no current.
  if (axis.motor.power().wantsEnabled()) append(steps, powerSteps(context(), axis));
  if (axis.motor.pinsAreDoubtful()) {
    add(steps, pinsStep(context(), axis, axis.motor.restore()));
    // Each pin on the way back that the failed change did not reach is already right.
    if (const int failed = axis.motor.failedMode(); failed != 0) {
      add(steps,
          pinsStep(context(), axis, axis.motor.pins().mode(failed, axis.motor.microsteps())));
    }
    add(steps, std::make_unique<RunStep>([&axis] { axis.motor.pinsRestored(); }));
  }
  add(steps, std::make_unique<RunStep>([this] { insert(setUpChips()); }));
  add(steps, std::make_unique<RunStep>([this] { insert(endFaultsOfDrivers()); }));
  add(steps, std::make_unique<RunStep>([this] { clearFault(); }));
  return braked(context(), axis, std::move(steps));
}

Steps Recover::setUpChips() {
  axis::AxisModel& axis = *axes().front();
  Steps steps;
  if (!context().mode.powered) return steps;
  // A chip without a fault keeps its current: the motor may hold a load.
  addSetUp(context(), axis, steps, SetUpChipsStep::Which::kFaulty,
           [&axis](const std::string& fault, const std::string& remedy) {
             axis.fault.latch(fault, remedy);
             axis.refuse("at fault: " + fault + "; " + remedy);
           });
  return steps;
}

std::optional<std::size_t> Recover::faultyFrom(std::size_t motor) const {
  const axis::AxisModel& axis = *axes().front();
  if (axis.motor.power().isAsleep() || !context().mode.powered) return {};
  const motor::MotorLines& lines = axis.motor.lines();
  for (; motor < lines.motors(); ++motor) {
    const int line = lines.motorAt(motor).fault;
    if (line < 0) continue;
    const bool level = axis.readInput(line) != 0;
    if (level == axis.config.motorAt(motor).driver.fault_active.value_or(false)) return motor;
  }
  return {};
}

Steps Recover::endFaultsOfDrivers() {
  axis::AxisModel& axis = *axes().front();
  const bool is_asleep = axis.motor.power().isAsleep();
  bool resets = false;
  std::optional<std::size_t> ended_by_enable;
  for (std::size_t i = 0; i < axis.config.motors(); ++i) {
    const config::MotorConfig& motor = axis.config.motorAt(i);
    // A sleeping chip doesn't report a fault that it may have kept.
    if (is_asleep ? !motor.fault : faultyFrom(i) != i) continue;
    const FaultEnd by = motor.driver.fault_end;
    resets = resets || (by == FaultEnd::kReset && motor.pins.reset.wired());
    if (by == FaultEnd::kEnable && motor.pins.enable.wired()) ended_by_enable = i;
  }
  Steps steps;
  if (!resets && !ended_by_enable) return steps;
  if (resets) add(steps, resetStep(context(), axis));
  if (ended_by_enable) append(steps, switchOffAndOn(*ended_by_enable));
  add(steps, std::make_unique<WaitStep>(context(), [&axis] { return axis.motor.state().ready; }));
  // The line has another level by then, which may be reported a little later.
  add(steps, std::make_unique<WaitStep>(
                 context(), [&axis] { return axis.motor.state().ready + kLevelIsTold; },
                 [this] { return !faultyFrom(0); }));
  return steps;
}

// A motor without current stays so; its driver has nothing more to be switched off.
Steps Recover::switchOffAndOn(std::size_t faulty) {
  axis::AxisModel& axis = *axes().front();
  Steps steps;
  if (!axis.motor.power().isEnabled()) return steps;
  if (axis.motor.enableIsHeldByOthers()) {
    axis.refuse(axis.chipText(faulty) + " still reports a fault on " +
                axis.chipAt(faulty).fault_name +
                "; ENABLE ends it, but keeps another axis enabled: disable that one first");
  }
  const auto wait = axis.config.timing().reset_low_ns;
  add(steps, enableStep(context(), axis, false, {}));
  add(steps, std::make_unique<WaitStep>(context(), [this, wait] { return context().now + wait; }));
  add(steps, enableStep(context(), axis, true, {}));
  return steps;
}

std::string Recover::whyItStays(std::size_t faulty) const {
  const config::MotorConfig& motor = axes().front()->config.motorAt(faulty);
  switch (motor.driver.fault_end) {
    case FaultEnd::kItself:
      return "; it ends by itself when its cause is gone";
    case FaultEnd::kReset:
      return motor.pins.reset.wired()
                 ? ""
                 : "; RESET isn't wired, so only switching its power off clears it";
    case FaultEnd::kEnable:
      return motor.pins.enable.wired()
                 ? ""
                 : "; ENABLE isn't wired, so only switching its power off clears it";
    case FaultEnd::kPower:
      break;
  }
  return "; only switching its power off clears it";
}

void Recover::clearFault() {
  axis::AxisModel& axis = *axes().front();
  if (const auto faulty = faultyFrom(0)) {
    axis.refuse(axis.chipText(*faulty) + " still reports a fault on " +
                axis.chipAt(*faulty).fault_name + whyItStays(*faulty));
  }
  if (context().stops_asked != context().stops_cleared) {
    axis.refuse("an emergency stop has come meanwhile");
  }
  axis.fault.clear();
}

// ---- scales ----

Steps ChangeMicrosteps::plan() {
  axis::AxisModel& axis = *axes().front();
  const std::int64_t common =
      axis.motor.translator().nearestCommon(axis.motor.state().count, wanted_);
  Steps steps;
  if (common != axis.motor.state().count) {
    append(steps, wakeSteps(context(), axis));
    Goal goal;
    goal.target = common;
    goal.velocity = axis.maxSpeed();
    goal.of_motor = true;
    goal.outcome = std::make_shared<axis::Outcome<axis::MoveResult>>();
    add(steps, std::make_unique<FollowStep>(
                   context(), std::vector<Order>{{&axis, goal}}, JoinPath(),
                   [] { return std::vector<Predecessor>(); }, [] { return SharedCall(); }));
    add(steps, std::make_unique<RunStep>([&axis, goal] {
          const auto result = goal.outcome->get();
          if (!result || result->end != axis::MoveEnd::kReached) {
            axis.refuse(result ? result->message : "it could not move to the common position");
          }
          axis.refuseUnlessOpen();
          if (axis.fault) axis.refuse("at fault: " + axis.fault.what() + "; call recover first");
        }));
  }
  add(steps, std::make_unique<PinsStep>(context(), axis, [this] { return writes(); }));
  return steps;
}

PinsStep::Writes ChangeMicrosteps::writes() {
  axis::AxisModel& axis = *axes().front();
  const pulse::ChannelState& state = axis.motor.state();
  const auto change = axis.motor.translator().changeTo(wanted_, state.count);
  // If Home has no count in the new mode, the counting restarts from Home, with the motor at the
  // same position. What is taken up of the backlash stays too, in parts of a microstep.
  double origin = axis.position.origin();
  if (!change.home_stays) {
    origin += static_cast<double>(state.count) / axis.stepsPerUnit() -
              static_cast<double>(change.count) / axis.stepsPerUnit(wanted_);
  }
  PinsStep::Writes writes;
  if (motor::TmcChip* chip = axis.motor.tmcAt(0)) {
    writes.registers = chip->changeMode(wanted_);
    writes.take = [chip](const bus::RegisterDone& done) { return chip->takeMode(done); };
  } else {
    writes.sequence = axis.motor.pins().mode(axis.motor.microsteps(), wanted_);
  }
  writes.scale = pulse::Command::Scale{change.count, axis.takenUpIn(wanted_, axis.takenUp()),
                                       axis.exactBacklash(wanted_), axis.switchRelease(wanted_)};
  writes.then = [&axis, change, origin] {
    if (motor::TmcChip* chip = axis.motor.tmcAt(0)) {
      chip->audit().begin(chip->mscnt(), change.count);
    }
    axis.motor.translator().changed(change);
    axis.position.rescale(origin);
  };
  writes.failed = [&axis, wanted = wanted_] { axis.motor.modeFailed(wanted); };
  return writes;
}

Steps RestorePosition::plan() {
  axis::AxisModel& axis = *axes().front();
  Steps steps;
  if (axis.config.backlash > 0.0) {
    add(steps, std::make_unique<PinsStep>(context(), axis, [this, &axis] {
          const int microsteps = axis.motor.microsteps();
          PinsStep::Writes writes;
          writes.scale =
              pulse::Command::Scale{axis.motor.state().count,
                                    axis.takenUpIn(microsteps, kept_.slack / axis.config.backlash),
                                    axis.exactBacklash(microsteps), axis.switchRelease(microsteps)};
          return writes;
        }));
  }
  add(steps, std::make_unique<RunStep>([this, &axis] {
        const double origin = kept_.position - axis.exactCount() / axis.stepsPerUnit();
        axis.position.restore(origin, doubt_, kept_.homed);
      }));
  return steps;
}

}  // namespace stepdriver::activity
