#include "rig_axis.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"

namespace stepdriver::sim {
namespace {

// Without a step for so long, a chip with registers says that it stands still: 2^20 clocks of 12
// MHz.
constexpr std::int64_t kStandstillNs = 87'000'000;
// Of such a chip.
constexpr double kFinestMode = 256.0;

const RigAxisSpec& checked(const RigAxisSpec& spec) {
  const std::vector<int>& known = spec.chip.microsteps;
  const bool is_known =
      known.empty() || std::find(known.begin(), known.end(), spec.microsteps) != known.end();
  if (!is_known || spec.microsteps < 1) {
    throw Error(fmt::format("axis {} of the rig: the {} doesn't do {} microsteps", spec.name,
                            spec.chip.title, spec.microsteps));
  }
  if (!(spec.full_step_travel > 0.0)) {
    throw Error(fmt::format("axis {} of the rig: full_step_travel is {}, but must be above 0",
                            spec.name, spec.full_step_travel));
  }
  return spec;
}

// An output of the driver is a contact that no carriage presses or releases.
std::optional<SwitchModel> madeContact(const std::string& line, bool active_level, bool pressed) {
  if (line.empty()) return std::nullopt;
  SwitchSpec spec;
  spec.line = line;
  spec.active_level = active_level;
  spec.position = std::numeric_limits<double>::infinity() * (pressed ? -1.0 : 1.0);
  return SwitchModel(spec, Side::kMax, 0.0);
}

std::optional<SwitchModel> madeSwitch(const std::optional<SwitchSpec>& spec, Side side,
                                      double carriage) {
  if (!spec) return std::nullopt;
  return SwitchModel(*spec, side, carriage);
}

}  // namespace

RigAxis::RigAxis(const RigAxisSpec& spec, Slides& slides)
    : spec_(checked(spec)),
      chip_(spec_),
      energized_(chip_.energized()),
      min_switch_(madeSwitch(spec_.min_switch, Side::kMin, spec_.start)),
      max_switch_(madeSwitch(spec_.max_switch, Side::kMax, spec_.start)),
      fault_(madeContact(spec_.fault_line, spec_.chip.fault_active.value_or(false), false)),
      in_position_(
          madeContact(spec_.in_position_line, spec_.chip.in_position_active.value_or(false), true)),
      stall_(madeContact(spec_.stall_line, spec_.stall_active, false)),
      slides_(slides) {
  for (const SwitchSpec& flag : spec_.flags) flags_.emplace_back(flag, Side::kMax, spec_.start);
  if (spec_.limits) judge_.emplace(*spec_.limits);
  if (spec_.brake) brake_.emplace(*spec_.brake);
  if (spec_.motor) swing_.emplace(*spec_.motor);
  if (spec_.spring) mass_.emplace(spec_.spring->frequency, spec_.spring->damping, spec_.start);
  if (spec_.tmc) {
    tmc_.emplace(*spec_.tmc);
    chip_.configure(tmc_->configured());
    energized_ = chip_.energized();
  }
  placeStops();
  settle(kForEver);
}

SwitchModel* RigAxis::switchAt(Side side) {
  std::optional<SwitchModel>& model = side == Side::kMin ? min_switch_ : max_switch_;
  return model ? &*model : nullptr;
}

void RigAxis::request(Pin pin, bool line_level, std::int64_t time_ns) {
  advance(time_ns);
  follow(chip_.request(pin, line_level, time_ns), time_ns);
}

void RigAxis::edge(Pin pin, bool line_level, std::int64_t time_ns) {
  advance(time_ns);
  const bool has_dir = spec_.chip.step_inputs == driver::StepInputs::kStepDir;
  if (pin == Pin::kDir && has_dir && line_level != chip_.lineLevel(pin)) noteTurn();
  follow(chip_.edge(pin, line_level, time_ns), time_ns);
}

void RigAxis::coilsWritten(std::int64_t time_ns) {
  advance(time_ns);
  follow(chip_.coilsWritten(time_ns), time_ns);
}

// The next step waits at most for all times of the chip from the last one on.
void RigAxis::noteTurn() {
  const driver::Timing& timing = spec_.chip.timing;
  slides_.add(timing.step_high_ns + timing.step_low_ns + timing.dir_hold_ns + timing.dir_setup_ns);
}

void RigAxis::judge(bool forward, std::int64_t time_ns) {
  // Without DIR, only the pulse itself shows the turn.
  const bool has_dir = spec_.chip.step_inputs == driver::StepInputs::kStepDir;
  if (!has_dir && std::exchange(last_forward_, forward) != forward) noteTurn();
  if (!judge_) return;
  const double way = static_cast<double>(spec_.microsteps) / chip_.microsteps();
  const auto violation = judge_->step(forward ? way : -way, time_ns, slides_.total());
  if (violation) chip_.count(*violation);
}

void RigAxis::setBrake(bool line_level, std::int64_t time_ns) {
  advance(time_ns);
  brake_->set(line_level, time_ns);
  if (energized_) snapRotor(time_ns);
}

void RigAxis::advance(std::int64_t time_ns) {
  turnIfDue(time_ns);
  fall(time_ns);
}

double RigAxis::fallUntil(std::int64_t time_ns) const {
  if (spec_.load_falls <= 0.0 || energized_ || fell_to_ns_ == kForEver) return 0.0;
  std::int64_t end = brake_ ? std::min(time_ns, brake_->holdsFrom()) : time_ns;
  if (isEnergizedAt(time_ns)) end = std::min(end, power_from_ns_);
  return spec_.load_falls * static_cast<double>(std::max<std::int64_t>(end - fell_to_ns_, 0)) / 1e9;
}

void RigAxis::fall(std::int64_t time_ns) {
  const double way = fallUntil(time_ns);
  fell_to_ns_ = time_ns;
  fell_ += way;
  rotor_ -= way * chip_.finest() / spec_.full_step_travel;
  if (way != 0.0) moveSwitches(time_ns);
  meetPower(time_ns);
}

void RigAxis::setPower(std::int64_t from_ns, std::int64_t time_ns) {
  advance(time_ns);
  power_from_ns_ = from_ns;
  if (from_ns > time_ns) {
    powers_up_ = true;
    energized_ = false;
    settle(time_ns);
  }
  meetPower(time_ns);
}

void RigAxis::meetPower(std::int64_t time_ns) {
  if (!powers_up_ || time_ns < power_from_ns_) return;
  powers_up_ = false;
  chip_.powerUp();
  if (tmc_) {
    tmc_->reset();
    chip_.configure(tmc_->configured());
  }
  if (spec_.chip.fault_end != driver::FaultEnd::kItself) mendChip();
  energized_ = isEnergizedAt(time_ns);
  if (energized_) snapRotor(time_ns);
  settle(time_ns);
  moveSwitches(time_ns);
}

void RigAxis::follow(const std::optional<ChipModel::Pulse>& pulse, std::int64_t time_ns) {
  const bool outputs_are_off = tmc_ && !tmc_->outputsOn();
  if (chip_.endsFault() || outputs_are_off || time_ns >= chip_fault_ends_ns_) mendChip();
  meetTrouble(time_ns);
  const bool was_energized = energized_;
  energized_ = isEnergizedAt(time_ns);
  if (pulse) takePulse(*pulse, time_ns);
  if (energized_ && !was_energized) snapRotor(time_ns);
  if (in_position_ && (pulse || energized_ != was_energized)) settle(time_ns);
  if (energized_) moveSwitches(time_ns);
}

void RigAxis::takePulse(const ChipModel::Pulse& pulse, std::int64_t time_ns) {
  ++(pulse.forward ? pulses_forward_ : pulses_backward_);
  if (last_pulse_ns_ != kForEver) step_interval_ns_ = time_ns - last_pulse_ns_;
  last_pulse_ns_ = time_ns;
  judge(pulse.forward, time_ns);
  for (const Side side : {Side::kMin, Side::kMax}) {
    SwitchModel* const contact = drives_.empty() ? switchAt(side) : nullptr;
    const bool is_ahead = pulse.forward == (side == Side::kMax);
    if (contact != nullptr && contact->noteStep(time_ns) && is_ahead) {
      chip_.count(Violation::kStepIntoSwitch);
    }
  }
  if (time_ns < power_from_ns_) chip_.count(Violation::kStepWithoutPower);
  const bool braked = brake_ && brake_->drags(time_ns);
  if (braked) chip_.count(Violation::kStepAgainstBrake);

  if (!energized_ || braked || pulse.moved == 0) return;
  turnRotor(time_ns);
  rotor_ += static_cast<double>(pulse.moved);
  stepped_ += pulse.moved;
  if (drives_.empty() && !blocksRotor()) meetBlock(pulse.moved);
  if (swing_) swing_->moveField(angleOf(static_cast<double>(pulse.moved)));
  if (tmc_) measureLoad(pulse, time_ns);
  for (const Drive& drive : drives_) drive.axis->noteMoved(time_ns);
  ++motor_steps_;
  // The loss is in the coupling, not in the rotor: the rotor then still agrees with the translator,
  // and the lost steps stay lost when the current is switched.
  if (faults_.lose_every > 0 && motor_steps_ % faults_.lose_every == 0) slipped_ += pulse.moved;
  if (faults_.chip_fault_after == motor_steps_) breakChip(time_ns);
}

// The loss is in the coupling, as in takePulse().
void RigAxis::meetBlock(std::int64_t moved) {
  const double place = carriage();
  const double rounding = 1e-3 * spec_.full_step_travel / chip_.finest();
  const bool blocked = moved > 0 ? spec_.block_max && place > *spec_.block_max + rounding
                                 : spec_.block_min && place < *spec_.block_min - rounding;
  if (blocked) slipped_ += moved;
  if (stall_) stall_->stick(blocked ? std::optional<bool>(true) : std::nullopt);
}

// After a pulse the motor takes its time to come to rest.
void RigAxis::settle(std::int64_t time_ns) {
  if (!in_position_) return;
  const bool never = !energized_ || faults_.never_in_position;
  in_position_->stick(false, never ? kNever : time_ns + spec_.settling_ns);
}

void RigAxis::snapRotor(std::int64_t time_ns) {
  if (!holdsRotor()) return;
  const auto phase = static_cast<double>(chip_.translator());
  const auto cycle = static_cast<double>(chip_.cycle());
  const double before = rotor_;
  rotor_ = phase + cycle * std::round((rotor_ - phase) / cycle);
  if (swing_ && rotor_ != before) swing_->snap(angleOf(rotor_ - before), time_ns);
  placeStops();
}

// [microsteps of the finest mode]
double RigAxis::atStop(const std::optional<double>& stop, double none) const {
  if (!stop) return none;
  return (*stop - spec_.start) * chip_.finest() / spec_.full_step_travel +
         static_cast<double>(slipped_);
}

void RigAxis::placeStops() {
  if (!blocksRotor()) return;
  constexpr double kNowhere = std::numeric_limits<double>::infinity();
  swing_->setStops(angleOf(rotor_ - atStop(spec_.block_max, kNowhere)),
                   angleOf(rotor_ - atStop(spec_.block_min, -kNowhere)));
}

double RigAxis::angleOf(double microsteps) const {
  return 2.0 * kPi * microsteps / static_cast<double>(chip_.cycle());
}

// Without current the friction stops the rotor, and so does the brake.
void RigAxis::turnIfDue(std::int64_t time_ns) {
  if (!swing_) return;
  if (!holdsRotor()) {
    constexpr double kNowhere = std::numeric_limits<double>::infinity();
    if (blocksRotor())
      rotor_ =
          std::clamp(rotor_, atStop(spec_.block_min, -kNowhere), atStop(spec_.block_max, kNowhere));
    swing_->rest(time_ns);
    return placeStops();
  }
  if (swing_->isDue(time_ns)) turnRotor(time_ns);
}

void RigAxis::turnRotor(std::int64_t time_ns) {
  if (!swing_) return;
  const std::int64_t behind = swing_->turnTo(time_ns);
  if (behind == 0) return;
  rotor_ -= static_cast<double>(behind * chip_.cycle());
  moveSwitches(time_ns);
}

void RigAxis::turnMotors(std::int64_t time_ns) {
  if (drives_.empty()) return turnIfDue(time_ns);
  for (const Drive& drive : drives_) drive.axis->turnIfDue(time_ns);
}

double RigAxis::slipUntil(std::int64_t time_ns) const {
  if (!swing_ || !holdsRotor()) return 0.0;
  RotorModel later = *swing_;
  return static_cast<double>(later.turnTo(time_ns)) * driver::kFullStepsPerCycle *
         spec_.full_step_travel;
}

void RigAxis::couple(std::vector<Drive> drives) { drives_ = std::move(drives); }

double RigAxis::motorWay() const {
  const double microsteps = rotor_ - static_cast<double>(slipped_);
  return microsteps * spec_.full_step_travel / chip_.finest();
}

double RigAxis::carriage() const {
  if (drives_.empty()) {
    const double place = spec_.start + motorWay();
    if (!blocksRotor()) return place;
    return std::clamp(place, spec_.block_min.value_or(place), spec_.block_max.value_or(place));
  }
  double way = 0.0;
  for (const Drive& drive : drives_) way += drive.carriage_way * drive.axis->motorWay();
  return spec_.start + way;
}

void RigAxis::moveSwitches(std::int64_t time_ns) {
  if (drives_.empty()) {
    pullMass(time_ns);
    return moveOwnSwitches(time_ns);
  }
  for (const Drive& drive : drives_) drive.axis->pullMass(time_ns);
  for (const Drive& drive : drives_) drive.axis->moveOwnSwitches(time_ns);
}

void RigAxis::pullMass(std::int64_t time_ns) {
  if (mass_) mass_->moveTo(carriage(), time_ns);
}

void RigAxis::moveOwnSwitches(std::int64_t time_ns) {
  if (min_switch_) min_switch_->follow(carriage(), time_ns);
  if (max_switch_) max_switch_->follow(carriage(), time_ns);
  for (SwitchModel& flag : flags_) flag.follow(carriage(), time_ns);
}

double RigAxis::steppedWay() const {
  double way = 0.0;
  for (const Drive& drive : drives_) {
    const RigAxis& motor = *drive.axis;
    way += drive.carriage_way * static_cast<double>(motor.stepped_) * motor.spec_.full_step_travel /
           motor.chip_.finest();
  }
  return way;
}

// The steps of its motors are not at the same time: each may be half a microstep ahead or behind,
// and where late steps catch up with their plan, each motor does so at a speed of its own. Only
// steps count: a rotor that snaps, a load that falls and a hand move the carriage as well.
void RigAxis::noteMoved(std::int64_t time_ns) {
  double apart = 0.25 * spec_.full_step_travel / chip_.microsteps();
  for (const Drive& drive : drives_) {
    const RigAxis& motor = *drive.axis;
    const double late =
        motor.spec_.limits ? motor.spec_.limits->late / motor.spec_.microsteps : 0.0;
    apart += std::abs(drive.carriage_way) * motor.spec_.full_step_travel *
             (1.0 / motor.chip_.microsteps() + late);
  }
  for (const Side side : {Side::kMin, Side::kMax}) {
    SwitchModel* const contact = switchAt(side);
    if (contact == nullptr) continue;
    const double place = side == Side::kMax ? steppedWay() : -steppedWay();
    double& farthest = farthest_.at(side == Side::kMax ? 1 : 0);
    if (!contact->noteStep(time_ns)) {
      farthest = place;
      continue;
    }
    if (place > farthest + apart) chip_.count(Violation::kStepIntoSwitch);
    farthest = std::min(farthest, place);
  }
}

void RigAxis::setFaults(const RigFaults& faults, std::int64_t time_ns) {
  advance(time_ns);
  faults_ = faults;
  chip_.mishear(faults.missed_pulses, faults.doubled_pulses);
  motor_steps_ = 0;
  if (min_switch_) min_switch_->stick(faults.min_stuck);
  if (max_switch_) max_switch_->stick(faults.max_stuck);
  settle(time_ns);
  if (faults.chip_fault_after == 0) breakChip(time_ns);
}

void RigAxis::breakChip(std::int64_t time_ns) {
  if (tmc_) tmc_->noteDriverError();
  const bool ends = spec_.chip.fault_end == driver::FaultEnd::kItself;
  chip_fault_ = true;
  chip_fault_ends_ns_ =
      ends && faults_.chip_fault_lasts_ns > 0 ? time_ns + faults_.chip_fault_lasts_ns : kNever;
  energized_ = false;
  if (fault_) fault_->stick(true, chip_fault_ends_ns_);
}

void RigAxis::mendChip() {
  chip_fault_ = false;
  chip_fault_ends_ns_ = kNever;
  if (fault_) fault_->stick({});
}

// ---- a serial interface ----

std::uint32_t RigAxis::readRegister(int number, std::int64_t time_ns) {
  return tmc_->read(number, senses(time_ns));
}

std::uint8_t RigAxis::statusByte(std::int64_t time_ns) const {
  return tmc_->statusByte(senses(time_ns));
}

TmcModel::Senses RigAxis::senses(std::int64_t time_ns) const {
  TmcModel::Senses senses;
  senses.enn = chip_.level(Pin::kEnable);
  senses.step = chip_.level(Pin::kStep);
  senses.dir = chip_.level(Pin::kDir);
  senses.diag = chip_fault_;
  senses.outputs_failed = chip_fault_;
  const std::int64_t cycle = chip_.cycle();
  senses.mscnt = static_cast<int>((chip_.translator() % cycle + cycle) % cycle);
  senses.standstill = last_pulse_ns_ == kForEver || time_ns - last_pulse_ns_ >= kStandstillNs;
  if (!senses.standstill) senses.tstep = tstep();
  return senses;
}

// The chip measures it once in a full step, and DIAG tells of a stall while steps come that are
// fast enough.
void RigAxis::measureLoad(const ChipModel::Pulse& pulse, std::int64_t time_ns) {
  const std::int64_t way = std::abs(pulse.moved);
  way_ += way;
  lag_over_way_ += std::abs(swing_ ? swing_->lag() : 0.0) * static_cast<double>(way);
  if (way_ < chip_.finest()) return;
  const double lag = lag_over_way_ / static_cast<double>(way_);
  way_ = 0;
  lag_over_way_ = 0.0;
  const bool stalls = tmc_->measure(lag, tstep());
  if (!fault_ || chip_fault_) return;
  if (!stalls) return fault_->stick({});
  const double slow = 1e9 / tmc_->clock() * tmc_->slowestStall() * kFinestMode / chip_.microsteps();
  fault_->stick(true, time_ns + std::llround(slow));
}

std::uint32_t RigAxis::tstep() const {
  constexpr std::uint32_t slowest = 0xFFFFF;
  if (!step_interval_ns_) return slowest;
  const double clocks =
      tmc_->clock() * 1e-9 * static_cast<double>(*step_interval_ns_) * chip_.microsteps();
  return static_cast<std::uint32_t>(std::min(clocks / kFinestMode, double{slowest}));
}

void RigAxis::writeRegister(int number, std::uint32_t value, std::int64_t time_ns) {
  advance(time_ns);
  tmc_->write(number, value);
  chip_.checkWrite(tmc_->configured(), time_ns);
  takeRegisters(time_ns);
}

void RigAxis::takeRegisters(std::int64_t time_ns) {
  if (swing_) swing_->setTorque(tmc_->torque());
  chip_.configure(tmc_->configured());
  follow({}, time_ns);
}

void RigAxis::powerChip(bool has_power, std::int64_t time_ns) {
  advance(time_ns);
  tmc_->setPower(has_power);
  tmc_->reset();
  chip_.powerUp();
  mendChip();
  takeRegisters(time_ns);
}

void RigAxis::setTrouble(const TmcTrouble& trouble, std::int64_t time_ns) {
  advance(time_ns);
  tmc_->setTrouble(trouble);
  takeRegisters(time_ns);
}

// A short circuit, and too much heat, switch the outputs off until they are disabled.
void RigAxis::meetTrouble(std::int64_t time_ns) {
  if (!tmc_ || chip_fault_ || !chip_.energized()) return;
  const TmcTrouble& trouble = tmc_->trouble();
  if (!trouble.over_temperature && !trouble.short_a && !trouble.short_b) return;
  breakChip(time_ns);
}

void RigAxis::turnBy(double way, std::int64_t time_ns) {
  rotor_ += way * chip_.finest() / spec_.full_step_travel;
  if (energized_) snapRotor(time_ns);
}

void RigAxis::placeCarriage(double position, std::int64_t time_ns) {
  advance(time_ns);
  const double way = position - carriage();
  if (drives_.empty()) turnBy(way, time_ns);
  for (const Drive& drive : drives_) drive.axis->turnBy(drive.motor_way * way, time_ns);
  moveSwitches(time_ns);
}

RigAxisReport RigAxis::report(std::int64_t time_ns) const {
  RigAxisReport report;
  report.pulses_forward = pulses_forward_;
  report.pulses_backward = pulses_backward_;
  report.translator = chip_.translator();
  const double falling = fallUntil(time_ns);
  report.fell = fell_ + falling;
  report.carriage = carriage() - falling;
  if (drives_.empty()) report.carriage -= slipUntil(time_ns);
  for (const Drive& drive : drives_) {
    report.carriage -= drive.carriage_way * drive.axis->slipUntil(time_ns);
  }
  if (mass_) report.ringing = mass_->ringing(time_ns);
  if (swing_) {
    RotorModel later = *swing_;
    if (holdsRotor()) later.turnTo(time_ns);
    report.largest_lag = later.largestLag() * 180.0 / kPi;
    report.lost_steps = driver::kFullStepsPerCycle * later.slips();
  }
  report.microsteps = chip_.microsteps();
  report.energized = energized_ || (powers_up_ && isEnergizedAt(time_ns));
  report.min_pressed = min_switch_ && min_switch_->active(time_ns);
  report.max_pressed = max_switch_ && max_switch_->active(time_ns);
  report.violations = chip_.violations();
  if (judge_) report.beyond_limits = judge_->firstViolation();
  return report;
}

}  // namespace stepdriver::sim
