#pragma once

#include <cstdint>
#include <optional>

#include "chip_model.h"
#include "stepdriver_core/sim/rig.h"
#include "switch_model.h"

namespace stepdriver::sim {

/// One axis of the rig: chip, rotor, carriage and switches, one moving the next.
class RigAxis {
 public:
  /// @throw std::invalid_argument if the chip can't do what the specification says.
  explicit RigAxis(const RigAxisSpec& spec);

  const RigAxisSpec& spec() const { return spec_; }
  const ChipModel& chip() const { return chip_; }

  /// @return nullptr if there is no such switch.
  const SwitchModel* switchAt(Side side) const;

  void request(Pin pin, bool line_level, std::int64_t time_ns);
  void edge(Pin pin, bool line_level, std::int64_t time_ns);
  /// The contact that pulls the fault line low; nullptr if that isn't wired.
  const SwitchModel* faultContact() const { return fault_ ? &*fault_ : nullptr; }
  void setFaults(const RigFaults& faults);
  void placeCarriage(double position, std::int64_t time_ns);
  RigAxisReport report(std::int64_t time_ns) const;

 private:
  double carriage() const;
  void follow(const std::optional<ChipModel::Pulse>& pulse, std::int64_t time_ns);
  void takePulse(const ChipModel::Pulse& pulse, std::int64_t time_ns);
  void setChipFault(bool faulty);
  void snapRotor();
  void moveSwitches(std::int64_t time_ns);

  const RigAxisSpec spec_;
  ChipModel chip_;
  bool energized_;
  double rotor_ = 0.0;  // microsteps of the finest mode, from its position when the rig was made
  std::int64_t slipped_ = 0;      // microsteps that the rotor made and the carriage didn't
  std::int64_t motor_steps_ = 0;  // since the faults were set
  std::int64_t pulses_forward_ = 0;
  std::int64_t pulses_backward_ = 0;
  RigFaults faults_;
  bool chip_fault_ = false;  // latched
  std::optional<SwitchModel> min_switch_, max_switch_;
  std::optional<SwitchModel> fault_;
};

}  // namespace stepdriver::sim
