#include "tmc_chip.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace stepdriver::motor {
namespace {

namespace tmc = driver::tmc;
using Kind = bus::RegisterAccess::Kind;

constexpr std::uint32_t kVersionMask = 0xFF000000U;
constexpr unsigned kVersionShift = 24;
// Without DIAG, so many samples in a row are a stall: a damaged one may be believed once.
constexpr int kStalledSamples = 2;
constexpr const char* kWireRemedy =
    "check the chip's motor supply, its address, the wire to PDN_UART and tmc/baud, then call "
    "recover";
constexpr const char* kSpiRemedy =
    "check the chip's supplies and the wires of its SPI, then call recover";
constexpr const char* kPortRemedy = "then call recover";
constexpr const char* kResetRemedy =
    "check the motor supply and its capacitor, then call recover, which writes all registers "
    "again, "
    "and home the axis or set its position";
constexpr const char* kHeatRemedy =
    "let it cool down, lower tmc/run_current_a or cool the chip, then call recover";
constexpr const char* kShortRemedy =
    "switch the power off and check the motor's wires, then call recover";
constexpr const char* kAuditRemedy =
    "check the wires to STEP and DIR and their ground, then call recover, and home the axis or set "
    "its position";
constexpr const char* kStallRemedy =
    "check what blocks the motor, and that its current and tmc/stall_fault_threshold suit its "
    "speed, then call recover, and home the axis or set its position";
constexpr const char* kSupplyRemedy = "check the motor supply, then call recover";

tmc::Settings settingsOf(const config::MotorConfig& motor) {
  const config::TmcConfig& config = *motor.tmc;
  tmc::Settings settings;
  settings.model = tmc::modelOf(motor.driver.name);
  settings.current = tmc::scaleOf(config.run_current, config.hold_current,
                                  {settings.model, config.sense_resistor});
  settings.hold_delay = config.hold_delay;
  settings.spread_cycle = config.mode == config::ChopperMode::kSpreadCycle;
  settings.spread_cycle_above = config.spread_cycle_above;
  settings.interpolate = config.interpolate;
  settings.both_edges = motor.driver.both_edges;
  if (config.stall_fault) {
    settings.stall_threshold = config.stall_fault->threshold;
    settings.stall_above = config.stall_fault->above;
  }
  return settings;
}

}  // namespace

TmcChip::TmcChip(const config::MotorConfig& motor) : motor_(motor), settings_(settingsOf(motor)) {
  state_.motor = motor.motor;
  if (tmc::isOnSpi(settings_.model)) state_.highest_stall_guard = 1023;
  noteCurrents();
}

void TmcChip::noteCurrents() {
  const tmc::CurrentScale scale = effective(settings_.current);
  state_.run_current = currentOf(scale.run);
  state_.hold_current = currentOf(scale.hold);
}

tmc::CurrentScale TmcChip::effective(tmc::CurrentScale scale) const {
  if (is_idle_) {
    scale.hold =
        std::min(scale.hold, tmc::scaleBelow(*config().idle_current, scale.range, board()));
  }
  return scale;
}

double TmcChip::currentOf(int scale) const {
  return tmc::currentOf(scale, settings_.current.range, board());
}

bus::RegisterJob TmcChip::jobOf(Accesses accesses) const {
  bus::RegisterJob job;
  job.port = config().port;
  job.baud = config().baud;
  job.accesses = std::move(accesses);
  return job;
}

tmc::Board TmcChip::board() const { return {settings_.model, config().sense_resistor}; }

bus::RegisterAccess TmcChip::read(std::uint8_t number, std::uint32_t volatile_bits) const {
  return {Kind::kRead, static_cast<std::uint8_t>(config().address), number, 0, volatile_bits};
}

bus::RegisterJob TmcChip::setUp(int microsteps, const std::vector<int>& port_addresses) const {
  const auto address = static_cast<std::uint8_t>(config().address);
  tmc::Settings settings = settings_;
  settings.current = effective(settings.current);
  const std::vector<tmc::RegisterValue> values = tmc::setUpOf(settings, microsteps);
  Accesses all;
  // An answer that comes too soon is a frame to the other chips, which then don't hear the next.
  for (const int other : tmc::isOnSpi(settings_.model) ? std::vector<int>() : port_addresses) {
    const tmc::RegisterValue& delay = values.front();
    all.push_back(
        {Kind::kUnchecked, static_cast<std::uint8_t>(other), delay.number, delay.value, 0});
  }
  all.push_back({Kind::kExpect, address, tmc::ioinOf(settings_.model),
                 tmc::versionOf(settings_.model) << kVersionShift, kVersionMask});
  for (const tmc::RegisterValue& value : values) {
    all.push_back({value.reads_back ? Kind::kWriteBack : Kind::kWrite, address, value.number,
                   value.value, 0});
  }
  all.push_back(readFlags());
  all.push_back({Kind::kWrite, address, tmc::kGstat, tmc::kGstatAll, 0});
  all.push_back(read(tmc::kMscnt));
  all.push_back(readFlags());
  all.push_back(read(tmc::kDrvStatus, tmc::volatileStatusOf(settings_.model)));
  bus::RegisterJob job = jobOf(std::move(all));
  job.writes_all = true;
  return job;
}

bus::RegisterJob TmcChip::changeMode(int microsteps) const {
  const auto address = static_cast<std::uint8_t>(config().address);
  return jobOf(
      {read(tmc::kMscnt),
       {Kind::kWriteBack, address, tmc::kChopconf, tmc::chopconfOf(settings_, microsteps, true), 0},
       read(tmc::kMscnt)});
}

// Reading clears the flags of a TMC2130: a second answer would be another one.
bus::RegisterAccess TmcChip::readFlags() const {
  return settings_.model == tmc::Model::kTmc2130 ? sample(tmc::kGstat) : read(tmc::kGstat);
}

bus::RegisterJob TmcChip::poll(bool audits) const {
  Accesses all{readFlags(), read(tmc::kDrvStatus, tmc::volatileStatusOf(settings_.model))};
  // On SPI no damaged answer hides or makes up a reset: a chip that has forgotten its mode isn't
  // set up. On a UART another master, or noise, may have put VREF in charge of the current.
  all.push_back(read(tmc::isOnSpi(settings_.model) ? tmc::kChopconf : tmc::kGconf));
  if (audits) all.push_back(read(tmc::kMscnt));
  return jobOf(std::move(all));
}

tmc::CurrentScale TmcChip::scaleOf(double run, double hold) const {
  const tmc::CurrentRange& range = settings_.current.range;
  return {tmc::scaleBelow(run, range, board()), tmc::scaleBelow(hold, range, board()), range};
}

bus::RegisterJob TmcChip::setCurrent(const tmc::CurrentScale& scale) {
  settings_.current = scale;
  return jobOf({write(tmc::kIholdIrun, tmc::currentsOf(effective(scale)))});
}

bus::RegisterJob TmcChip::setStallThreshold(int threshold) {
  settings_.stall_threshold = threshold;
  return jobOf({tmc::isOnSpi(settings_.model)
                    ? write(tmc::kCoolconfOnSpi, tmc::coolconfOf(threshold))
                    : write(tmc::kSgthrs, static_cast<std::uint32_t>(threshold))});
}

std::optional<tmc::Thresholds> TmcChip::stallThresholds() const {
  if (!tmc::isOnSpi(settings_.model) && !config().stall_fault) return {};
  return tmc::stallThresholdsOf(settings_.model);
}

bus::RegisterJob TmcChip::setIdle(bool idle) {
  is_idle_ = idle;
  return setCurrent(settings_.current);
}

bus::RegisterAccess TmcChip::write(std::uint8_t number, std::uint32_t value) const {
  return {Kind::kWrite, static_cast<std::uint8_t>(config().address), number, value, 0};
}

tmc::CurrentScale TmcChip::stallScale() const {
  tmc::CurrentScale scale = settings_.current;
  scale.run = tmc::scaleBelow(config().stall->current, scale.range, board());
  scale.hold = std::min(scale.hold, scale.run);
  return scale;
}

bus::RegisterAccess TmcChip::writeBack(std::uint8_t number, std::uint32_t value) const {
  bus::RegisterAccess access = write(number, value);
  access.kind = Kind::kWriteBack;
  return access;
}

bus::RegisterJob TmcChip::prepareStall() const {
  const int threshold = config().stall->threshold;
  Accesses all{write(tmc::kTcoolthrs, 0), write(tmc::kIholdIrun, tmc::currentsOf(stallScale()))};
  if (tmc::isOnSpi(settings_.model)) {
    all.push_back(write(tmc::kCoolconfOnSpi, tmc::coolconfOf(threshold)));
    all.push_back(writeBack(tmc::kGconf, tmc::gconfForStallOnSpi()));
  } else {
    all.push_back(write(tmc::kTpwmthrs, 0));
    all.push_back(write(tmc::kSgthrs, static_cast<std::uint32_t>(threshold)));
  }
  all.push_back(read(tmc::kMscnt));
  return jobOf(std::move(all));
}

// A threshold is good for speeds from 80 % on of the one that it was found at.
bus::RegisterJob TmcChip::armStall(double speed) const {
  constexpr double kSlowest = 0.8;
  return jobOf({write(tmc::kTcoolthrs, tmc::thresholdOf(kSlowest * speed, settings_.model))});
}

bus::RegisterAccess TmcChip::sample(std::uint8_t number) const {
  bus::RegisterAccess access = read(number);
  access.kind = Kind::kSample;
  return access;
}

bus::RegisterJob TmcChip::readLoad() const {
  return jobOf({sample(tmc::loadRegisterOf(settings_.model))});
}

bool TmcChip::isStall(std::uint32_t load) const {
  return tmc::isStall(settings_.model, load, config().stall->threshold);
}

bool TmcChip::measuresLoad() const {
  if (tmc::isOnSpi(settings_.model)) return settings_.spread_cycle;
  return tmc::detectsStalls(settings_.model);
}

bus::RegisterJob TmcChip::sampleLoad() const {
  const std::uint8_t load = tmc::loadRegisterOf(settings_.model);
  return jobOf({sample(load), sample(tmc::kTstep), sample(tmc::kDrvStatus)});
}

bus::RegisterJob TmcChip::disarmStall() const {
  return jobOf({write(tmc::kTcoolthrs, 0), read(tmc::kMscnt)});
}

bus::RegisterJob TmcChip::endStall() const {
  const std::uint32_t currents = tmc::currentsOf(effective(settings_.current));
  const auto threshold = [this](double speed) { return tmc::thresholdOf(speed, settings_.model); };
  if (tmc::isOnSpi(settings_.model)) {
    return jobOf({write(tmc::kTcoolthrs, 0), writeBack(tmc::kGconf, tmc::gconfOf(settings_)),
                  write(tmc::kCoolconfOnSpi, tmc::coolconfOf(settings_.stall_threshold)),
                  write(tmc::kIholdIrun, currents),
                  write(tmc::kTcoolthrs, threshold(settings_.stall_above))});
  }
  return jobOf({write(tmc::kTcoolthrs, 0),
                write(tmc::kSgthrs, static_cast<std::uint32_t>(settings_.stall_threshold)),
                write(tmc::kTpwmthrs, threshold(settings_.spread_cycle_above)),
                write(tmc::kIholdIrun, currents),
                write(tmc::kTcoolthrs, threshold(settings_.stall_above))});
}

std::string TmcChip::takeStall(const bus::RegisterDone& done) {
  count(done);
  return done.failure == bus::Failure::kNone ? "" : failureText(done);
}

std::string TmcChip::takeEndOfStall(const bus::RegisterDone& done) {
  ending_stall = 0;
  std::string why = takeStall(done);
  if (why.empty()) prepared_for_stall_ = false;
  return why;
}

void TmcChip::count(const bus::RegisterDone& done) {
  state_.transactions += done.transactions;
  state_.retries += done.retries;
}

std::string TmcChip::place() const {
  if (tmc::isOnSpi(settings_.model)) return "on " + config().port;
  return fmt::format("on {} at address {}", config().port, config().address);
}

std::string TmcChip::failureText(const bus::RegisterDone& done) {
  state_.is_set_up = false;
  if (done.failure == bus::Failure::kPort) {
    remedy_ = kPortRemedy;
    return done.port_error;
  }
  remedy_ = tmc::isOnSpi(settings_.model) ? kSpiRemedy : kWireRemedy;
  return fmt::format("{}, {}", place(), bus::causeOf(done.failure));
}

std::string TmcChip::takeSetUp(const bus::RegisterDone& done) {
  count(done);
  state_.is_set_up = false;
  if (done.failure == bus::Failure::kMismatch &&
      done.failed_number == tmc::ioinOf(settings_.model)) {
    remedy_ = "give the driver that is there, then start again";
    return fmt::format("{} says that it is {} (version {:02X}h)", place(),
                       tmc::nameOfVersion(done.found >> kVersionShift),
                       done.found >> kVersionShift);
  }
  if (done.failure != bus::Failure::kNone) return failureText(done);
  chopconf_ = done.values[done.values.size() - 6];
  kept_power_ = (done.values[done.values.size() - 5] & tmc::kGstatReset) == 0;
  mscnt_ = static_cast<int>(done.values[done.values.size() - 3]);
  const std::uint32_t gstat = done.values[done.values.size() - 2];
  const tmc::Status status = tmc::statusOf(settings_.model, done.values.back());
  takeStatus(status);
  noteCurrents();
  std::string fault = faultOf(gstat, status);
  state_.is_set_up = fault.empty();
  prepared_for_stall_ = false;
  return fault;
}

std::string TmcChip::takeMode(const bus::RegisterDone& done) {
  count(done);
  if (done.failure != bus::Failure::kNone) return failureText(done);
  chopconf_ = done.values.at(1);
  mscnt_ = static_cast<int>(done.values.back());
  if (done.values.front() == done.values.back()) return "";
  state_.is_set_up = false;
  remedy_ = kWireRemedy;
  return fmt::format("its microstep counter moved from {} to {} while its mode was changed at rest",
                     done.values.front(), done.values.back());
}

std::string TmcChip::takePoll(const bus::RegisterDone& done) {
  count(done);
  if (done.failure != bus::Failure::kNone) return failureText(done);
  const tmc::Status status = tmc::statusOf(settings_.model, done.values.at(1));
  std::uint32_t flags = done.values.front();
  if (tmc::isOnSpi(settings_.model) && done.values.at(2) != chopconf_) flags |= tmc::kGstatReset;
  takeStatus(status);
  constexpr std::size_t with_mscnt = 4;  // poll(true)
  if (done.values.size() == with_mscnt) mscnt_ = static_cast<int>(done.values.back());
  std::string fault = faultOf(flags, status);
  const bool is_changed =
      !tmc::isOnSpi(settings_.model) && done.values.at(2) != tmc::gconfOf(settings_);
  if (!fault.empty() || !is_changed) return fault;
  state_.is_set_up = false;
  remedy_ = kWireRemedy;
  return fmt::format(
      "has {:X}h in its register GCONF, but {:X}h was written: another master writes as well, or "
      "the "
      "wire picks up noise{}",
      done.values.at(2), tmc::gconfOf(settings_),
      (done.values.at(2) & tmc::kGconfScaleByVref) != 0 ? "; VREF sets its current now" : "");
}

std::string TmcChip::takeSample(const bus::RegisterDone& done, double position, double velocity) {
  sampling = 0;
  count(done);
  if (done.failure != bus::Failure::kNone) return "";
  const tmc::Status status = tmc::statusOf(settings_.model, done.values.back());
  stalled_samples_ = isStalled(done, status) ? stalled_samples_ + 1 : 0;
  if (!measures(status)) return "";
  state_.stall_guard = status.stall_guard.value_or(static_cast<int>(done.values.front()));
  state_.stall_guard_position = position;
  state_.stall_guard_velocity = velocity;
  return stalled_samples_ < kStalledSamples ? "" : stallFault();
}

bool TmcChip::measures(const tmc::Status& status) const {
  const bool is_stealthy = status.stealth_chop.value_or(!settings_.spread_cycle);
  return !status.standstill && is_stealthy != tmc::isOnSpi(settings_.model);
}

// With DIAG the chip says it itself.
bool TmcChip::isStalled(const bus::RegisterDone& done, const tmc::Status& status) const {
  if (!config().stall_fault || motor_.fault) return false;
  const bool is_fast =
      done.values.at(1) <= tmc::thresholdOf(settings_.stall_above, settings_.model);
  return is_fast && measures(status) &&
         tmc::isStall(settings_.model, done.values.front(), settings_.stall_threshold);
}

std::string TmcChip::stallFault() {
  if (!config().stall_fault) return "";
  stalled_samples_ = 0;
  remedy_ = kStallRemedy;
  return "reports that the motor has stalled";
}

std::string TmcChip::takeIdle(const bus::RegisterDone& done) {
  setting_idle = 0;
  count(done);
  noteCurrents();
  return done.failure == bus::Failure::kNone ? "" : failureText(done);
}

std::string TmcChip::takeSetting(const bus::RegisterDone& done) {
  count(done);
  if (done.failure != bus::Failure::kNone) return failureText(done);
  noteCurrents();
  return "";
}

std::string TmcChip::audited(std::int64_t count, int microsteps) {
  if (!stands_still_) return "";
  remedy_ = kAuditRemedy;
  return audit_.check(mscnt_, count, microsteps);
}

void TmcChip::takeStatus(const tmc::Status& status) {
  stands_still_ = status.standstill;
  state_.present_current = currentOf(status.present_scale);
  state_.stealth_chop = status.stealth_chop.value_or(!settings_.spread_cycle);
  state_.temperature_warning = status.temperature_warning;
  state_.open_load_a = status.open_load_a;
  state_.open_load_b = status.open_load_b;
  state_.at_least_celsius = status.at_least_celsius;
  // At rest it keeps its value. Samples have its place, too.
  if (status.stall_guard && measures(status) && !measuresLoad()) {
    state_.stall_guard = status.stall_guard;
  }
}

std::string TmcChip::faultOf(std::uint32_t gstat, const tmc::Status& status) {
  if ((gstat & tmc::kGstatReset) != 0) {
    state_.is_set_up = false;
    remedy_ = kResetRemedy;
    return "was reset, and has forgotten its current and its microsteps: its supply failed for a "
           "moment";
  }
  if (status.over_temperature) {
    remedy_ = kHeatRemedy;
    return "has switched itself off because of over-temperature";
  }
  if (status.short_circuit != nullptr) {
    remedy_ = kShortRemedy;
    return fmt::format("reports a short circuit of {}", status.short_circuit);
  }
  if ((gstat & tmc::kGstatUndervoltage) != 0) {
    remedy_ = kSupplyRemedy;
    return "reports an undervoltage of its charge pump: its motor supply is too low";
  }
  if ((gstat & tmc::kGstatDriverError) != 0) {
    remedy_ = kShortRemedy;
    return "has switched itself off because of over-temperature or a short circuit";
  }
  return "";
}

}  // namespace stepdriver::motor
