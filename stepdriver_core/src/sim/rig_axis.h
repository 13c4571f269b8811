#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "brake_model.h"
#include "chip_model.h"
#include "motion_judge.h"
#include "rotor_model.h"
#include "spring_mass.h"
#include "stepdriver_core/sim/rig.h"
#include "switch_model.h"
#include "tmc_model.h"

namespace stepdriver::sim {

/// One axis of the rig: chip, rotor, carriage and switches, one moving the next.
class RigAxis {
 public:
  /// @param slides of the rig, outlives the axis.
  /// @throw Error if the chip can't do what the specification says.
  RigAxis(const RigAxisSpec& spec, Slides& slides);

  /// A motor that moves the carriage of a coupled axis.
  struct Drive {
    RigAxis* axis = nullptr;    ///< whose motor it is
    double carriage_way = 0.0;  ///< [mm|deg] the way of this carriage for each of the motor
    double motor_way = 0.0;     ///< [mm|deg] the way of the motor for each of this carriage
  };
  /// @param drives of its carriage, its own motor among them. They live as long as this.
  void couple(std::vector<Drive> drives);

  const RigAxisSpec& spec() const { return spec_; }
  const ChipModel& chip() const { return chip_; }

  /// @return nullptr if there is no such switch.
  SwitchModel* switchAt(Side side);

  void request(Pin pin, bool line_level, std::int64_t time_ns);
  void edge(Pin pin, bool line_level, std::int64_t time_ns);
  /// A write has ended: of a motor whose coils are switched by lines.
  void coilsWritten(std::int64_t time_ns);
  void released(Pin pin) { chip_.released(pin); }
  /// nullptr if there is none.
  const BrakeModel* brake() const { return brake_ ? &*brake_ : nullptr; }
  /// The line of the brake has this level from now on. @pre There is a brake.
  void setBrake(bool line_level, std::int64_t time_ns);
  /// The power of the motor is there from this time on: kForEver if nothing switches it, kNever
  /// while it is off.
  void setPower(std::int64_t from_ns, std::int64_t time_ns);
  /// The contact that pulls the fault line low; nullptr if that isn't wired.
  SwitchModel* faultContact() { return fault_ ? &*fault_ : nullptr; }
  /// The contact of the in-position output; nullptr if that isn't wired.
  SwitchModel* inPositionContact() { return in_position_ ? &*in_position_ : nullptr; }
  /// The contacts of its flags.
  std::deque<SwitchModel>& flags() { return flags_; }
  /// The contact of the output that reports a block; nullptr if that isn't wired.
  SwitchModel* stallContact() { return stall_ ? &*stall_ : nullptr; }
  void setFaults(const RigFaults& faults, std::int64_t time_ns);
  void placeCarriage(double position, std::int64_t time_ns);
  /// @name Its chip's serial interface; it must have one
  /// @{
  bool hasSerial() const { return tmc_.has_value(); }
  bool serialHasPower(std::int64_t time_ns) const {
    return tmc_->spec().has_power && time_ns >= power_from_ns_;
  }
  std::uint32_t readRegister(int number, std::int64_t time_ns);
  std::uint8_t statusByte(std::int64_t time_ns) const;
  bool isOnSpi() const { return tmc_->isOnSpi(); }
  std::uint32_t writtenRegister(int number) const { return tmc_->written(number); }
  void writeRegister(int number, std::uint32_t value, std::int64_t time_ns);
  void powerChip(bool has_power, std::int64_t time_ns);
  void setTrouble(const TmcTrouble& trouble, std::int64_t time_ns);
  /// @}
  void clockStalled() {
    if (judge_) judge_->forget();
  }
  /// Its motors turn until this time, which may take its carriage off a switch, or onto one: the
  /// program reads them.
  void turnMotors(std::int64_t time_ns);
  RigAxisReport report(std::int64_t time_ns) const;

 private:
  double carriage() const;
  double motorWay() const;
  /// [mm|deg] How far the steps of its motors alone have moved the carriage of a coupled axis.
  double steppedWay() const;
  /// A motor has moved its carriage, which others move too.
  void noteMoved(std::int64_t time_ns);
  void moveOwnSwitches(std::int64_t time_ns);
  /// By hand. @param way [mm|deg] of the motor.
  void turnBy(double way, std::int64_t time_ns);
  void follow(const std::optional<ChipModel::Pulse>& pulse, std::int64_t time_ns);
  void takePulse(const ChipModel::Pulse& pulse, std::int64_t time_ns);
  void noteTurn();
  void judge(bool forward, std::int64_t time_ns);
  void breakChip(std::int64_t time_ns);
  void takeRegisters(std::int64_t time_ns);
  std::uint32_t tstep() const;
  TmcModel::Senses senses(std::int64_t time_ns) const;
  void meetTrouble(std::int64_t time_ns);
  void mendChip();
  void settle(std::int64_t time_ns);
  void snapRotor(std::int64_t time_ns);
  /// The chip measures the load: a block stops the rotor itself.
  bool blocksRotor() const {
    return tmc_ && swing_ && drives_.empty() && (spec_.block_min || spec_.block_max);
  }
  /// The places of the blocks relative to the field, which may have jumped.
  void placeStops();
  double atStop(const std::optional<double>& stop, double none) const;
  void measureLoad(const ChipModel::Pulse& pulse, std::int64_t time_ns);
  /// [electrical rad] The angle of a way of the rotor.
  double angleOf(double microsteps) const;
  /// The motor has current, and no brake holds it.
  bool holdsRotor() const { return energized_ && (!brake_ || brake_->isReleased()); }
  void turnRotor(std::int64_t time_ns);
  void turnIfDue(std::int64_t time_ns);
  /// [mm|deg] By how much the rotor falls behind from the last event to a time.
  double slipUntil(std::int64_t time_ns) const;
  /// All that happens between two events.
  void advance(std::int64_t time_ns);
  /// [mm|deg] How far the load sinks from the last event to a time.
  double fallUntil(std::int64_t time_ns) const;
  bool isEnergizedAt(std::int64_t time_ns) const {
    return chip_.energized() && !chip_fault_ && time_ns >= power_from_ns_;
  }
  void meetPower(std::int64_t time_ns);
  void fall(std::int64_t time_ns);
  void moveSwitches(std::int64_t time_ns);
  void pullMass(std::int64_t time_ns);
  /// A step has turned the rotor. Against a block the carriage stays.
  void meetBlock(std::int64_t moved);

  const RigAxisSpec spec_;
  ChipModel chip_;
  std::optional<TmcModel> tmc_;
  bool energized_;
  // The place at which the rotor comes to rest, in microsteps of the finest mode from its position
  // when the rig was made.
  double rotor_ = 0.0;
  std::optional<RotorModel> swing_;  // the rotor's motion around that place
  std::int64_t stepped_ = 0;         // microsteps by which pulses have moved the rotor
  std::int64_t slipped_ = 0;         // microsteps that the rotor made and the carriage didn't
  std::int64_t motor_steps_ = 0;     // since the faults were set
  std::int64_t pulses_forward_ = 0;
  std::int64_t pulses_backward_ = 0;
  double fell_ = 0.0;                   // [mm|deg]
  std::int64_t fell_to_ns_ = kForEver;  // the load has sunk until this time
  RigFaults faults_;
  bool chip_fault_ = false;
  std::int64_t chip_fault_ends_ns_ = kNever;
  std::optional<SwitchModel> min_switch_, max_switch_;
  std::optional<SwitchModel> fault_;
  std::optional<SwitchModel> in_position_;
  std::deque<SwitchModel> flags_;
  std::optional<SwitchModel> stall_;
  std::optional<BrakeModel> brake_;
  std::optional<SpringMass> mass_;
  std::vector<Drive> drives_;  // empty: its own motor alone
  // [mm|deg] Of a coupled axis: how far outwards its steps may take it, by side.
  std::array<double, 2> farthest_{};
  Slides& slides_;
  std::optional<MotionJudge> judge_;
  bool last_forward_ = false;  // the direction of the last pulse
  std::int64_t last_pulse_ns_ = kForEver;
  std::optional<std::int64_t> step_interval_ns_;  // between the last two pulses
  // Since the chip has measured its load.
  std::int64_t way_ = 0;  // [microsteps of the finest mode]
  double lag_over_way_ = 0.0;
  std::int64_t power_from_ns_ = kForEver;
  bool powers_up_ = false;  // as soon as the power is there
};

}  // namespace stepdriver::sim
