#include "tmc_chip.h"

#include <fmt/format.h>

#include <utility>

namespace stepdriver::motor {
namespace {

namespace tmc = driver::tmc;
using Kind = bus::RegisterAccess::Kind;

constexpr std::uint32_t kVersionMask = 0xFF000000U;
constexpr unsigned kVersionShift = 24;
constexpr std::uint32_t kVersion2208 = 0x20;
constexpr std::uint32_t kVersion2209 = 0x21;  // and of the TMC2226

constexpr const char* kWireRemedy =
    "check the chip's motor supply, its address and the wire to PDN_UART, then call recover";
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
constexpr const char* kSupplyRemedy = "check the motor supply, then call recover";

bool is2208(const config::MotorConfig& motor) { return motor.driver.name == "tmc2208"; }

tmc::Settings settingsOf(const config::MotorConfig& motor) {
  const config::TmcConfig& config = *motor.tmc;
  tmc::Settings settings;
  settings.current = tmc::scaleOf(config.run_current, config.hold_current, config.sense_resistor);
  settings.hold_delay = config.hold_delay;
  settings.spread_cycle = config.mode == config::ChopperMode::kSpreadCycle;
  settings.interpolate = config.interpolate;
  settings.both_edges = motor.driver.both_edges;
  settings.has_stall_guard = !is2208(motor);
  return settings;
}

const char* nameOfVersion(std::uint32_t version) {
  switch (version) {
    case kVersion2208:
      return "a TMC2208 or TMC2225";
    case kVersion2209:
      return "a TMC2209 or TMC2226";
    default:
      return "another chip";
  }
}

}  // namespace

TmcChip::TmcChip(const config::MotorConfig& motor)
    : motor_(motor),
      settings_(settingsOf(motor)),
      version_(is2208(motor) ? kVersion2208 : kVersion2209) {
  state_.motor = motor.motor;
  noteCurrents();
}

void TmcChip::noteCurrents() {
  state_.run_current = currentOf(settings_.current.run);
  state_.hold_current = currentOf(settings_.current.hold);
}

double TmcChip::currentOf(int scale) const {
  return tmc::currentOf(scale, settings_.current.fine, config().sense_resistor);
}

bus::RegisterJob TmcChip::jobOf(Accesses accesses) const {
  bus::RegisterJob job;
  job.port = config().port;
  job.baud = config().baud;
  job.accesses = std::move(accesses);
  return job;
}

bus::RegisterAccess TmcChip::read(std::uint8_t number, std::uint32_t volatile_bits) const {
  return {Kind::kRead, static_cast<std::uint8_t>(config().address), number, 0, volatile_bits};
}

bus::RegisterJob TmcChip::setUp(int microsteps, const std::vector<int>& port_addresses) const {
  const auto address = static_cast<std::uint8_t>(config().address);
  const std::vector<tmc::RegisterValue> values = tmc::setUpOf(settings_, microsteps);
  Accesses all;
  // An answer that comes too soon is a frame to the other chips, which then don't hear the next.
  for (const int other : port_addresses) {
    const tmc::RegisterValue& delay = values.front();
    all.push_back(
        {Kind::kUnchecked, static_cast<std::uint8_t>(other), delay.number, delay.value, 0});
  }
  all.push_back({Kind::kExpect, address, tmc::kIoin, version_ << kVersionShift, kVersionMask});
  for (const tmc::RegisterValue& value : values) {
    all.push_back({value.reads_back ? Kind::kWriteBack : Kind::kWrite, address, value.number,
                   value.value, 0});
  }
  all.push_back(read(tmc::kGstat));
  all.push_back({Kind::kWrite, address, tmc::kGstat, tmc::kGstatAll, 0});
  all.push_back(read(tmc::kMscnt));
  all.push_back(read(tmc::kGstat));
  all.push_back(read(tmc::kDrvStatus, tmc::kVolatileStatus));
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

bus::RegisterJob TmcChip::poll(bool audits) const {
  Accesses all{read(tmc::kGstat), read(tmc::kDrvStatus, tmc::kVolatileStatus)};
  if (settings_.has_stall_guard) {
    bus::RegisterAccess load = read(tmc::kSgResult);
    load.kind = Kind::kSample;
    all.push_back(load);
  }
  if (audits) all.push_back(read(tmc::kMscnt));
  return jobOf(std::move(all));
}

tmc::CurrentScale TmcChip::scaleOf(double run, double hold) const {
  const bool fine = settings_.current.fine;
  return {tmc::scaleBelow(run, fine, config().sense_resistor),
          tmc::scaleBelow(hold, fine, config().sense_resistor), fine};
}

bus::RegisterJob TmcChip::setCurrent(const tmc::CurrentScale& scale) const {
  return jobOf({{Kind::kWrite, static_cast<std::uint8_t>(config().address), tmc::kIholdIrun,
                 tmc::currentsOf(scale), 0}});
}

void TmcChip::count(const bus::RegisterDone& done) {
  state_.transactions += done.transactions;
  state_.retries += done.retries;
}

std::string TmcChip::failureText(const bus::RegisterDone& done) {
  state_.is_set_up = false;
  if (done.failure == bus::Failure::kPort) {
    remedy_ = kPortRemedy;
    return done.port_error;
  }
  remedy_ = kWireRemedy;
  return fmt::format("on {} at address {}, {}", config().port, config().address,
                     bus::causeOf(done.failure));
}

std::string TmcChip::takeSetUp(const bus::RegisterDone& done) {
  count(done);
  state_.is_set_up = false;
  if (done.failure == bus::Failure::kMismatch && done.failed_number == tmc::kIoin) {
    remedy_ = "give the driver that is there, then start again";
    return fmt::format("on {} at address {} says that it is {} (version {:02X}h)", config().port,
                       config().address, nameOfVersion(done.found >> kVersionShift),
                       done.found >> kVersionShift);
  }
  if (done.failure != bus::Failure::kNone) return failureText(done);
  kept_power_ = (done.values[done.values.size() - 5] & tmc::kGstatReset) == 0;
  mscnt_ = static_cast<int>(done.values[done.values.size() - 3]);
  const std::uint32_t gstat = done.values[done.values.size() - 2];
  const std::uint32_t status = done.values.back();
  takeStatus(status);
  std::string fault = faultOf(gstat, status);
  state_.is_set_up = fault.empty();
  return fault;
}

std::string TmcChip::takeMode(const bus::RegisterDone& done) {
  count(done);
  if (done.failure != bus::Failure::kNone) return failureText(done);
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
  const std::uint32_t status = done.values.at(1);
  takeStatus(status);
  // It is measured in motion, and keeps its value at rest.
  if (settings_.has_stall_guard && (status & tmc::kStandstill) == 0) {
    state_.stall_guard = static_cast<int>(done.values.at(2));
  }
  mscnt_ = static_cast<int>(done.values.back());  // if it was asked for
  return faultOf(done.values.front(), status);
}

std::string TmcChip::takeCurrent(const tmc::CurrentScale& scale, const bus::RegisterDone& done) {
  count(done);
  if (done.failure != bus::Failure::kNone) return failureText(done);
  settings_.current = scale;
  noteCurrents();
  return "";
}

std::string TmcChip::audited(std::int64_t count, int microsteps) {
  if (!stands_still_) return "";
  remedy_ = kAuditRemedy;
  return audit_.check(mscnt_, count, microsteps);
}

void TmcChip::takeStatus(std::uint32_t status) {
  const auto has = [status](std::uint32_t bit) { return (status & bit) != 0; };
  stands_still_ = has(tmc::kStandstill);
  state_.present_current =
      currentOf(static_cast<int>((status & tmc::kPresentScale) >> tmc::kPresentScaleShift));
  state_.stealth_chop = has(tmc::kStealthChop);
  state_.temperature_warning = has(tmc::kOverTemperatureWarning);
  state_.open_load_a = has(tmc::kOpenLoadA);
  state_.open_load_b = has(tmc::kOpenLoadB);
  state_.at_least_celsius = has(tmc::kAbove157)   ? 157
                            : has(tmc::kAbove150) ? 150
                            : has(tmc::kAbove143) ? 143
                            : has(tmc::kAbove120) ? 120
                                                  : 0;
}

std::string TmcChip::faultOf(std::uint32_t gstat, std::uint32_t status) {
  const auto is = [status](std::uint32_t bit) { return (status & bit) != 0; };
  if ((gstat & tmc::kGstatReset) != 0) {
    state_.is_set_up = false;
    remedy_ = kResetRemedy;
    return "was reset, and has forgotten its current and its microsteps: its supply failed for a "
           "moment";
  }
  if (is(tmc::kOverTemperature)) {
    remedy_ = kHeatRemedy;
    return "has switched itself off because of over-temperature";
  }
  for (const auto& [bit, what] : {std::pair{tmc::kShortToGroundA, "coil A to ground"},
                                  std::pair{tmc::kShortToGroundB, "coil B to ground"},
                                  std::pair{tmc::kShortToSupplyA, "coil A to the supply"},
                                  std::pair{tmc::kShortToSupplyB, "coil B to the supply"}}) {
    if (!is(bit)) continue;
    remedy_ = kShortRemedy;
    return fmt::format("reports a short circuit of {}", what);
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
