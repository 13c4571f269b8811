#pragma once

#include <array>
#include <cstdint>

#include "chip_model.h"
#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {

/// The registers of a TMC2208, TMC2209, TMC2130 or TMC5160 according to its datasheet. It doesn't
/// know what a program means by them.
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
    /// TSTEP: clocks for 1/256 of a full step, by the last two steps.
    std::uint32_t tstep = 0xFFFFF;
    bool outputs_failed = false;  ///< a short or over-temperature has switched them off
  };

  /// The supply is there again.
  void reset();
  void write(int number, std::uint32_t value);
  /// Registers that can't be read read as 0. Reading clears flags of a TMC2130.
  std::uint32_t read(int number, const Senses& senses);
  bool isOnSpi() const { return spec_.version == kVersion2130 || spec_.version == kVersion5160; }
  /// The byte that comes before each answer on SPI.
  std::uint8_t statusByte(const Senses& senses) const;
  /// What was written last, whether it can be read or not.
  std::uint32_t written(int number) const {
    return registers_.at(static_cast<std::size_t>(number));
  }

  /// @name What its registers mean to the motor
  /// @{
  ChipModel::Configured configured() const;
  bool outputsOn() const;
  /// [Hz] With which it counts times.
  double clock() const;
  /// The torque, as a part of that of the run current with which its outputs were switched on
  /// first: the motor was chosen for that.
  double torque() const;
  /// A full step was made. @param lag [electrical rad] of the rotor behind the field
  /// @return whether DIAG tells of a stall.
  bool measure(double lag, std::uint32_t tstep);
  /// [clocks] TSTEP above which it tells nothing of a stall.
  std::uint32_t slowestStall() const { return written(kTcoolthrsNumber); }
  /// Its own pulses turn the motor (VACTUAL).
  bool turnsByItself() const { return !isOnSpi() && written(kVactualNumber) != 0; }
  /// @}

  const TmcSpec& spec() const { return spec_; }
  void setPower(bool has_power) { spec_.has_power = has_power; }
  const TmcTrouble& trouble() const { return trouble_; }
  void setTrouble(const TmcTrouble& trouble) { trouble_ = trouble; }
  /// Something has switched its outputs off: GSTAT keeps that.
  void noteDriverError() { driver_error_ = true; }

 private:
  static constexpr int kVersion2130 = 0x11;
  static constexpr int kVersion5160 = 0x30;
  static constexpr int kVactualNumber = 0x22;
  static constexpr int kTcoolthrsNumber = 0x14;

  int microsteps() const;
  int shiftOfLoad() const;
  std::uint32_t runOf() const;
  bool isStealthy(std::uint32_t tstep) const;
  std::uint32_t status(const Senses& senses) const;
  std::uint32_t statusOnSpi(const Senses& senses) const;
  std::uint32_t inputs(const Senses& senses) const;
  std::uint32_t gstat() const;

  TmcSpec spec_;
  TmcTrouble trouble_;
  std::array<std::uint32_t, 128> registers_{};
  std::uint8_t writes_ = 0;  // IFCNT
  bool was_reset_ = true;
  bool driver_error_ = false;
  std::uint32_t first_run_ = 0;  // IRUN + 1; 0: they weren't yet
  std::uint32_t stall_guard_ = 0;
};

}  // namespace stepdriver::sim
