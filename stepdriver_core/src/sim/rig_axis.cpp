#include "rig_axis.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace stepdriver::sim {
namespace {

const RigAxisSpec& checked(const RigAxisSpec& spec) {
  const driver::DriverChip& chip = driver::driverChipOf(spec.model);
  const std::vector<int>& known = chip.microsteps;
  if (std::find(known.begin(), known.end(), spec.microsteps) == known.end()) {
    throw std::invalid_argument(fmt::format("Axis {} of the rig: a {} doesn't do {} microsteps.",
                                            spec.name, chip.title, spec.microsteps));
  }
  if (!(spec.full_step_travel > 0.0)) {
    throw std::invalid_argument(
        fmt::format("Axis {} of the rig: full_step_travel is {:f}, it has to be above 0.",
                    spec.name, spec.full_step_travel));
  }
  return spec;
}

// The open drain of nFAULT is a contact that no carriage presses.
std::optional<SwitchModel> madeFaultContact(const std::string& line) {
  if (line.empty()) return std::nullopt;
  SwitchSpec spec;
  spec.line = line;
  spec.position = std::numeric_limits<double>::infinity();
  return SwitchModel(spec, Side::kMax, 0.0);
}

std::optional<SwitchModel> madeSwitch(const std::optional<SwitchSpec>& spec, Side side,
                                      double carriage) {
  if (!spec) return std::nullopt;
  return SwitchModel(*spec, side, carriage);
}

}  // namespace

RigAxis::RigAxis(const RigAxisSpec& spec)
    : spec_(checked(spec)),
      chip_(spec_),
      energized_(chip_.energized()),
      min_switch_(madeSwitch(spec_.min_switch, Side::kMin, spec_.start)),
      max_switch_(madeSwitch(spec_.max_switch, Side::kMax, spec_.start)),
      fault_(madeFaultContact(spec_.fault_line)) {}

const SwitchModel* RigAxis::switchAt(Side side) const {
  const std::optional<SwitchModel>& model = side == Side::kMin ? min_switch_ : max_switch_;
  return model ? &*model : nullptr;
}

void RigAxis::request(Pin pin, bool line_level, std::int64_t time_ns) {
  follow(chip_.request(pin, line_level, time_ns), time_ns);
}

void RigAxis::edge(Pin pin, bool line_level, std::int64_t time_ns) {
  follow(chip_.edge(pin, line_level, time_ns), time_ns);
}

void RigAxis::follow(const std::optional<ChipModel::Pulse>& pulse, std::int64_t time_ns) {
  if (chip_.inReset()) setChipFault(false);
  const bool was_energized = energized_;
  energized_ = chip_.energized() && !chip_fault_;
  if (pulse) takePulse(*pulse, time_ns);
  if (energized_ && !was_energized) snapRotor();
  if (energized_) moveSwitches(time_ns);
}

void RigAxis::takePulse(const ChipModel::Pulse& pulse, std::int64_t time_ns) {
  ++(pulse.forward ? pulses_forward_ : pulses_backward_);
  const SwitchModel* const ahead = switchAt(pulse.forward ? Side::kMax : Side::kMin);
  if (ahead != nullptr && ahead->active(time_ns)) chip_.count(Violation::kStepIntoSwitch);

  if (!energized_ || pulse.moved == 0) return;
  rotor_ += static_cast<double>(pulse.moved);
  ++motor_steps_;
  // The loss is in the coupling, not in the rotor: the rotor then still agrees with the translator,
  // and the lost steps stay lost when the current is switched.
  if (faults_.lose_every > 0 && motor_steps_ % faults_.lose_every == 0) slipped_ += pulse.moved;
  if (faults_.chip_fault_after == motor_steps_) setChipFault(true);
}

void RigAxis::snapRotor() {
  const auto phase = static_cast<double>(chip_.translator());
  const auto cycle = static_cast<double>(chip_.cycle());
  rotor_ = phase + cycle * std::round((rotor_ - phase) / cycle);
}

double RigAxis::carriage() const {
  const double microsteps = rotor_ - static_cast<double>(slipped_);
  return spec_.start + microsteps * spec_.full_step_travel / chip_.finest();
}

void RigAxis::moveSwitches(std::int64_t time_ns) {
  if (min_switch_) min_switch_->follow(carriage(), time_ns);
  if (max_switch_) max_switch_->follow(carriage(), time_ns);
}

void RigAxis::setFaults(const RigFaults& faults) {
  faults_ = faults;
  motor_steps_ = 0;
  if (min_switch_) min_switch_->stick(faults.min_stuck);
  if (max_switch_) max_switch_->stick(faults.max_stuck);
  if (faults.chip_fault_after == 0) setChipFault(true);
}

void RigAxis::setChipFault(bool faulty) {
  chip_fault_ = faulty;
  if (faulty) energized_ = false;
  if (fault_) fault_->stick(faulty ? std::optional<bool>(true) : std::nullopt);
}

void RigAxis::placeCarriage(double position, std::int64_t time_ns) {
  rotor_ = (position - spec_.start) * chip_.finest() / spec_.full_step_travel +
           static_cast<double>(slipped_);
  if (energized_) snapRotor();
  moveSwitches(time_ns);
}

RigAxisReport RigAxis::report(std::int64_t time_ns) const {
  RigAxisReport report;
  report.pulses_forward = pulses_forward_;
  report.pulses_backward = pulses_backward_;
  report.translator = chip_.translator();
  report.carriage = carriage();
  report.microsteps = chip_.microsteps();
  report.energized = energized_;
  report.min_pressed = min_switch_ && min_switch_->active(time_ns);
  report.max_pressed = max_switch_ && max_switch_->active(time_ns);
  report.violations = chip_.violations();
  return report;
}

}  // namespace stepdriver::sim
