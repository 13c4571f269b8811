#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "bus/register_job.h"
#include "driver/tmc_registers.h"
#include "step_audit.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::motor {

/// The registers of a motor's driver chip, as the controller knows them: what is to be written, and
/// what the answers mean. It has no port.
class TmcChip {
 public:
  /// @param motor has a TmcConfig; outlives it.
  explicit TmcChip(const config::MotorConfig& motor);

  const config::TmcConfig& config() const { return *motor_.tmc; }

  /// All registers, in their order, each write verified; then the chip's flags are cleared and
  /// read. The chip's version comes first: another chip is left alone.
  ///
  /// @param port_addresses of all chips on its wire, which must not answer too soon.
  bus::RegisterJob setUp(int microsteps, const std::vector<int>& port_addresses) const;
  /// Another microstep mode. MSCNT is read before and after: the place in the electrical cycle must
  /// stay.
  bus::RegisterJob changeMode(int microsteps) const;
  /// What the chip says of itself. @param audits MSCNT, too.
  bus::RegisterJob poll(bool audits = false) const;
  /// SG_RESULT can be read in motion, with sampleLoad().
  bool measuresLoad() const;
  /// SG_RESULT, and how the chip chops. @pre measuresLoad()
  bus::RegisterJob sampleLoad() const;
  /// The scale of currents [A rms] in the range that is configured.
  driver::tmc::CurrentScale scaleOf(double run, double hold) const;
  /// [A rms] The lowest current in that range.
  double lowestCurrent() const { return currentOf(0); }
  /// Other currents, which all later jobs keep, too.
  bus::RegisterJob setCurrent(const driver::tmc::CurrentScale& scale);
  /// Another threshold of stalls in any motion, which all later jobs keep, too.
  bus::RegisterJob setStallThreshold(int threshold);
  /// Those that can be set. Empty: none has a use, as SG_RESULT doesn't depend on it, and a stall
  /// is no fault.
  std::optional<driver::tmc::Thresholds> stallThresholds() const;
  /// At rest the current of the idle timeout, or again as before. @pre config().idle_current
  bus::RegisterJob setIdle(bool idle);
  /// setIdle(true) was the last one.
  bool isIdle() const { return is_idle_; }
  std::uint64_t setting_idle = 0;  ///< the job of setIdle() under way; 0: none

  /// @name A homing to a stall. @pre config().stall
  /// @{
  /// The current and the threshold for it. Its value is MSCNT.
  bus::RegisterJob prepareStall() const;
  /// From now on the chip tells of a stall at DIAG, if it is fast enough. @param speed [full
  /// steps/s] of the motor
  bus::RegisterJob armStall(double speed) const;
  /// The register with SG_RESULT.
  bus::RegisterJob readLoad() const;
  /// Whether the value of readLoad() is a stall.
  bool isStall(std::uint32_t load) const;
  /// It tells of no stall any more. Its value is MSCNT.
  bus::RegisterJob disarmStall() const;
  /// The registers are as before prepareStall().
  bus::RegisterJob endStall() const;
  /// Takes the answers to any of these. @return why it failed; empty if it didn't.
  std::string takeStall(const bus::RegisterDone& done);
  /// Takes the answers to endStall().
  std::string takeEndOfStall(const bus::RegisterDone& done);
  /// prepareStall() was sent, and endStall() hasn't succeeded yet.
  bool isPreparedForStall() const { return prepared_for_stall_; }
  void notePreparedForStall() { prepared_for_stall_ = true; }
  std::uint64_t ending_stall = 0;  ///< the job of endStall() under way; 0: none
  /// @}

  /// Takes the answers to setUp(). @return why the chip isn't ready; empty if it is.
  std::string takeSetUp(const bus::RegisterDone& done);
  /// Takes the answers to changeMode(). @return why the mode isn't changed; empty if it is.
  std::string takeMode(const bus::RegisterDone& done);
  /// Takes the answers to poll(). @return a fault, without the name of the chip; empty if there is
  ///   none.
  std::string takePoll(const bus::RegisterDone& done);
  /// Takes the answers to sampleLoad(), when the axis had this position [unit] and velocity
  /// [unit/s]. If there is none, the next poll says why.
  /// @return a fault, as takePoll(): the motor has stalled.
  std::string takeSample(const bus::RegisterDone& done, double position, double velocity);
  /// The fault output was active in a motion, and a poll has found nothing that explains it but a
  /// stall. @return the fault, as takePoll(); empty: it isn't configured.
  std::string stallFault();
  /// Takes the answer to setIdle(). @return why it failed; empty if it didn't.
  std::string takeIdle(const bus::RegisterDone& done);
  /// Takes the answer to setCurrent() or setStallThreshold(). @return why the chip doesn't have it;
  /// empty if it does.
  std::string takeSetting(const bus::RegisterDone& done);

  /// [1/256 full step] Its place in the electrical cycle when it was set up, or audited last.
  int mscnt() const { return mscnt_; }
  /// All its registers are as they must be, as far as it is known.
  bool isSetUp() const { return state_.is_set_up; }
  /// They aren't any more: the chip has lost them, or it doesn't answer.
  void forget() { state_.is_set_up = false; }
  const driver::DriverState& state() const { return state_; }
  /// The remedy for the fault that takeSetUp(), takeMode() or takePoll() said last.
  const std::string& remedy() const { return remedy_; }

  /// Compares the MSCNT of the last takePoll() with the count at which the motor has been at rest
  /// since the poll. @return a fault, as takePoll().
  std::string audited(std::int64_t count, int microsteps);
  StepAudit& audit() { return audit_; }
  const StepAudit& audit() const { return audit_; }
  /// It hadn't been reset when it was set up: it has counted the steps since its last start,
  /// whoever sent them.
  bool keptItsPower() const { return kept_power_; }
  /// It stood still when it was asked last.
  bool standsStill() const { return stands_still_; }

  /// @name The poll under way, which the controller asks for
  /// @{
  std::uint64_t polling = 0;  ///< its job; 0: none
  /// The count of the motor, if MSCNT is asked for and the motor has been at rest since.
  std::optional<std::int64_t> resting_count;
  /// Its fault output was active: the poll says why.
  bool asks_for_cause = false;
  pulse::Nanoseconds next_poll = 0;
  pulse::Nanoseconds next_audit = 0;
  /// @}

  /// @name The sample of its load under way, the same way
  /// @{
  std::uint64_t sampling = 0;  ///< its job; 0: none
  pulse::Nanoseconds sampled_since = 0;
  pulse::Nanoseconds next_sample = 0;
  /// @}

 private:
  using Accesses = std::vector<bus::RegisterAccess>;

  bus::RegisterJob jobOf(Accesses accesses) const;
  bus::RegisterAccess write(std::uint8_t number, std::uint32_t value) const;
  bus::RegisterAccess read(std::uint8_t number, std::uint32_t volatile_bits = 0) const;
  bus::RegisterAccess sample(std::uint8_t number) const;
  bus::RegisterAccess writeBack(std::uint8_t number, std::uint32_t value) const;
  void count(const bus::RegisterDone& done);
  std::string failureText(const bus::RegisterDone& done);
  void takeStatus(const driver::tmc::Status& status);
  bus::RegisterAccess readFlags() const;
  driver::tmc::Board board() const;
  std::string place() const;  // "on /dev/serial0 at address 1"
  void noteCurrents();
  /// With the hold current of the idle timeout, if that is over.
  driver::tmc::CurrentScale effective(driver::tmc::CurrentScale scale) const;
  /// It measures its load: it moves, and chops as it must for that.
  bool measures(const driver::tmc::Status& status) const;
  bool isStalled(const bus::RegisterDone& done, const driver::tmc::Status& status) const;
  driver::tmc::CurrentScale stallScale() const;
  double currentOf(int scale) const;  // [A rms]
  /// What of these flags stops the motor.
  std::string faultOf(std::uint32_t gstat, const driver::tmc::Status& status);

  const config::MotorConfig& motor_;
  driver::tmc::Settings settings_;
  driver::DriverState state_;
  std::string remedy_;
  bool prepared_for_stall_ = false;
  bool is_idle_ = false;
  int stalled_samples_ = 0;     // in a row
  std::uint32_t chopconf_ = 0;  // as it was read back
  int mscnt_ = 0;
  bool stands_still_ = false;
  bool kept_power_ = false;
  StepAudit audit_;
};

}  // namespace stepdriver::motor
