#pragma once

#include <array>
#include <cstdint>

#include "chip_model.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {

/// The registers of a TMC2208 or TMC2209 according to its datasheet. It doesn't know what a program
/// means by them.
class TmcModel {
 public:
  explicit TmcModel(const TmcSpec& spec);

  /// What the chip senses apart from its registers.
  struct Senses {
    bool enn = false;  ///< the levels of its pins
    bool step = false;
    bool dir = false;
    bool diag = false;
    int mscnt = 0;
    bool standstill = true;
    bool outputs_failed = false;  ///< a short or over-temperature has switched them off
    double lag = 0.0;             ///< [electrical rad] of the rotor behind the field
  };

  /// The supply is there again.
  void reset();
  void write(int number, std::uint32_t value);
  /// Registers that can't be read read as 0.
  std::uint32_t read(int number, const Senses& senses) const;
  /// What was written last, whether it can be read or not.
  std::uint32_t written(int number) const {
    return registers_.at(static_cast<std::size_t>(number));
  }

  /// @name What its registers mean to the motor
  /// @{
  ChipModel::Configured configured() const;
  bool outputsOn() const;
  /// The torque, as a part of that of the first run current that was written: the motor was chosen
  /// for that.
  double torque() const;
  /// Its own pulses turn the motor (VACTUAL).
  bool turnsByItself() const { return written(kVactualNumber) != 0; }
  /// @}

  const TmcSpec& spec() const { return spec_; }
  void setPower(bool has_power) { spec_.has_power = has_power; }
  const TmcTrouble& trouble() const { return trouble_; }
  void setTrouble(const TmcTrouble& trouble) { trouble_ = trouble; }
  /// Something has switched its outputs off: GSTAT keeps that.
  void noteDriverError() { driver_error_ = true; }

 private:
  static constexpr int kVactualNumber = 0x22;

  int microsteps() const;
  std::uint32_t runOf() const { return (registers_[0x10] >> 8U & 0x1FU) + 1; }
  std::uint32_t stallGuard(const Senses& senses) const;
  std::uint32_t status(const Senses& senses) const;

  TmcSpec spec_;
  TmcTrouble trouble_;
  std::array<std::uint32_t, 128> registers_{};
  std::uint8_t writes_ = 0;  // IFCNT
  bool was_reset_ = true;
  bool driver_error_ = false;
  std::uint32_t first_run_ = 0;  // IRUN + 1; 0: nothing was written yet
  mutable std::uint32_t stall_guard_ = 0;
};

}  // namespace stepdriver::sim
