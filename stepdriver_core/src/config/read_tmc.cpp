#include "read_tmc.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "driver/tmc_registers.h"
#include "message_text.h"
#include "motion_keys.h"
#include "stepdriver_core/driver/driver_chip.h"

namespace stepdriver::config {
namespace {

namespace tmc = driver::tmc;

const std::vector<std::string> kChips = {"tmc2208", "tmc2209", "tmc2226", "tmc2130", "tmc5160"};
const std::vector<std::string> kModes = {"stealthchop", "spreadcycle"};
const std::vector<std::string> kEdges = {"one", "both"};
// The chip measures the rate of each frame with its clock, up to 500 kbaud.
const std::vector<int> kBauds = {9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000};
constexpr int kMostAddress = 3;
// Boards have 50 to 150 mOhm; motors of less than 0.2 A have more.
constexpr Range kResistors{10.0, 1000.0};
constexpr double kMilliohm = 1e-3;
constexpr double kHalf = 0.5;
// Of a current that was written with its digits and read again.
constexpr double kRounded = 1e-9;

const char* aboveKey(Kind kind) {
  return kind == Kind::kLinear ? "spreadcycle_above_mm_s" : "spreadcycle_above_deg_s";
}

const char* stallFaultKey(Kind kind) {
  return kind == Kind::kLinear ? "stall_fault_above_mm_s" : "stall_fault_above_deg_s";
}

/// [mm|degrees] of a full step of an axis.
double fullStepTravel(const AxisConfig& axis) {
  const auto units_per_si = static_cast<double>(motionKeys(axis.kind).units_per_si_unit);
  return units_per_si * axis.microsteps / axis.steps_per_unit;
}

class TmcReader {
 public:
  TmcReader(ConfigReader& motor, driver::DriverChip& chip)
      : reader_(motor.map("tmc")),
        chip_(chip),
        is_on_spi_(driver::registerBusOf(chip) == driver::RegisterBus::kSpi) {}

  std::optional<TmcConfig> read(UsedPorts& used) {
    const std::size_t before = reader_.issues().size();
    TmcConfig config;
    if (is_on_spi_) {
      readSpi(config);
    } else {
      readUart(config);
    }
    const auto mode = reader_.findOneOf("mode", kModes, Presence::kOptional);
    config.mode = mode == kModes.back() ? ChopperMode::kSpreadCycle : ChopperMode::kStealthChop;
    config.interpolate = reader_.boolean("interpolate", config.interpolate);
    if (const auto edges = reader_.findOneOf("step_edges", kEdges, Presence::kOptional)) {
      chip_.both_edges = edges == kEdges.back();
    }
    for (const Kind kind : {Kind::kLinear, Kind::kRotary}) {
      reader_.allow(aboveKey(kind));
      reader_.allow(stallFaultKey(kind));
    }
    const bool has_stall = readStall(config);
    readStallFault(config);
    config.hold_delay = reader_.number(
        "hold_delay_s", {0.0, tmc::longestHoldDelay(tmc::modelOf(chip_.name))}, config.hold_delay);
    readCurrents(config);
    if (has_stall) readStallCurrent(config);
    reader_.rejectUnknown();
    if (reader_.issues().size() != before) return {};
    used.add(reader_, config);
    if (reader_.issues().size() != before) return {};
    return config;
  }

 private:
  /// @return whether there is a threshold, and nothing is wrong.
  bool readStall(TmcConfig& config) {
    const std::size_t before = reader_.issues().size();
    const tmc::Thresholds range = tmc::stallThresholdsOf(tmc::modelOf(chip_.name));
    const int threshold = reader_.integer("stall_threshold", range.least, range.most, 0);
    const int phase = reader_.integer("stall_phase", 0, tmc::kMscntPerCycle - 1, 0);
    stall_current_ = reader_.findNumber("stall_current_a", Range::positive(), Presence::kOptional);
    if (!reader_.has("stall_threshold")) {
      for (const char* key : {"stall_phase", "stall_current_a"}) {
        if (!reader_.has(key)) continue;
        reader_.contradiction(key, fmt::format("is {}, but {} is missing", reader_.shown(key),
                                               reader_.fullName("stall_threshold")));
      }
      return false;
    }
    // A homing on SPI chops as it must.
    if (!is_on_spi_) refuseUnlessDetected("stall_threshold", config);
    config.stall.emplace();
    config.stall->threshold = threshold;
    if (reader_.has("stall_phase")) config.stall->phase = phase;
    return reader_.issues().size() == before;
  }

  /// In StealthChop by StallGuard4, on SPI in SpreadCycle by StallGuard2.
  void refuseUnlessDetected(const char* key, const TmcConfig& config) {
    if (!tmc::detectsStalls(tmc::modelOf(chip_.name))) {
      reader_.contradiction(
          key, fmt::format("is {}, but the {} detects no stalls", reader_.shown(key), chip_.title));
    }
    const ChopperMode mode = is_on_spi_ ? ChopperMode::kSpreadCycle : ChopperMode::kStealthChop;
    if (config.mode != mode) {
      reader_.contradiction(
          key, fmt::format("is {}, but the chip detects stalls in {} only", reader_.shown(key),
                           is_on_spi_ ? "spreadcycle" : "stealthchop"));
    }
  }

  /// Its speed is read by readTmcSpeeds().
  void readStallFault(TmcConfig& config) {
    constexpr const char* kThreshold = "stall_fault_threshold";
    const tmc::Thresholds range = tmc::stallThresholdsOf(tmc::modelOf(chip_.name));
    const int threshold = reader_.integer(kThreshold, range.least, range.most, 0);
    if (!reader_.has(kThreshold)) return;
    refuseUnlessDetected(kThreshold, config);
    config.stall_fault.emplace();
    config.stall_fault->threshold = threshold;
  }

  void readStallCurrent(TmcConfig& config) {
    config.stall->current = stall_current_.value_or(config.run_current);
    if (!stall_current_ || config.run_current <= 0.0 || config.sense_resistor <= 0.0) return;
    const tmc::Board board{tmc::modelOf(chip_.name), config.sense_resistor};
    isWithin("stall_current_a", *stall_current_, tmc::lowestHold(config.run_current, board),
             config.run_current);
  }

  std::string readDevice(const char* key, const char* what) {
    const auto path = reader_.findText(key, Presence::kRequired);
    if (path && (path->empty() || path->front() != '/')) {
      reader_.issue(key,
                    fmt::format("is {}, but must be the path of {}", reader_.shown(key), what));
    }
    return path.value_or("");
  }

  void readUart(TmcConfig& config) {
    config.port = readDevice("port", "a serial port, such as \"/dev/serial0\"");
    config.baud = reader_.findOneOf("baud", kBauds, Presence::kOptional).value_or(config.baud);
    config.address = readAddress();
  }

  void readSpi(TmcConfig& config) {
    config.port = readDevice("spi", "an SPI device, such as \"/dev/spidev0.0\"");
    config.baud = 0;
  }

  int readAddress() {
    if (chip_.name != kChips.front()) return reader_.integer("address", 0, kMostAddress);
    const int address = reader_.integer("address", 0, kMostAddress, 0);
    if (address != 0) {
      reader_.contradiction("address", fmt::format("is {}, but a {} has no address pins: it must "
                                                   "be 0, and the chip alone on its port",
                                                   address, chip_.title));
    }
    return address;
  }

  /// A current outside of what the board can make shows that the resistor is another one.
  bool isWithin(const char* key, double current, double least, double most) {
    if (current >= least * (1.0 - kRounded) && current <= most * (1.0 + kRounded)) return true;
    reader_.issue(
        key, fmt::format("is {}, but must be from {} to {}: with a sense resistor of {} mOhm the "
                         "board makes no other current; read the value off the board",
                         numberText(current), lowerBoundText(least), upperBoundText(most),
                         reader_.shown("sense_resistor_mohm")));
    return false;
  }

  void readCurrents(TmcConfig& config) {
    const auto resistor =
        reader_.findNumber("sense_resistor_mohm", kResistors, Presence::kRequired);
    const auto run = reader_.findNumber("run_current_a", Range::positive(), Presence::kRequired);
    const auto hold = reader_.findNumber("hold_current_a", Range::positive(), Presence::kOptional);
    const auto idle = reader_.findNumber("idle_current_a", Range::positive(), Presence::kOptional);
    if (!resistor || !run) return;
    const double sense = *resistor * kMilliohm;
    config.sense_resistor = sense;
    config.run_current = *run;
    const tmc::Board board{tmc::modelOf(chip_.name), sense};
    if (!isWithin("run_current_a", *run, tmc::lowestCurrent(board), tmc::highestCurrent(board))) {
      return;
    }
    const double least = tmc::lowestHold(*run, board);
    config.hold_current = hold.value_or(std::max(*run * kHalf, least));
    if (!isWithin("hold_current_a", config.hold_current, least, *run)) return;
    config.idle_current = idle;
    if (idle) isWithin("idle_current_a", *idle, least, config.hold_current);
  }

  ConfigReader reader_;
  driver::DriverChip& chip_;
  const bool is_on_spi_;
  std::optional<double> stall_current_;
};

ConfigValue::Map writtenTmc(const TmcConfig& tmc) {
  ConfigValue::Map map;
  if (tmc.baud == 0) {
    map["spi"] = tmc.port;
  } else {
    map["port"] = tmc.port;
    map["baud"] = tmc.baud;
    map["address"] = tmc.address;
  }
  const ConfigValue::Map others{{"sense_resistor_mohm", tmc.sense_resistor / kMilliohm},
                                {"run_current_a", tmc.run_current},
                                {"hold_current_a", tmc.hold_current},
                                {"hold_delay_s", tmc.hold_delay},
                                {"mode", kModes.at(tmc.mode == ChopperMode::kSpreadCycle ? 1 : 0)},
                                {"interpolate", tmc.interpolate}};
  map.insert(others.begin(), others.end());
  if (tmc.idle_current) map["idle_current_a"] = *tmc.idle_current;
  if (tmc.stall_fault) map["stall_fault_threshold"] = tmc.stall_fault->threshold;
  if (tmc.stall) {
    map["stall_threshold"] = tmc.stall->threshold;
    map["stall_current_a"] = tmc.stall->current;
    if (tmc.stall->phase) map["stall_phase"] = *tmc.stall->phase;
  }
  return map;
}

}  // namespace

void UsedPorts::add(ConfigReader& tmc, const TmcConfig& chip) {
  Port& port = ports_[chip.port];
  if (chip.baud == 0) {
    const auto [other, is_new] = port.chips.emplace(chip.address, tmc.fullName("spi"));
    if (!is_new) {
      tmc.contradiction("spi", fmt::format("is {}, but must be another one: it is {} already",
                                           tmc.shown("spi"), other->second));
    }
    return;
  }
  if (port.chips.empty()) {
    port.baud = chip.baud;
    port.key = tmc.fullName("baud");
  } else if (port.baud != chip.baud) {
    tmc.contradiction("baud", fmt::format("is {}, but must be {}, as {}: it is the same port",
                                          chip.baud, port.baud, port.key));
  }
  const auto [other, is_new] = port.chips.emplace(chip.address, tmc.fullName("address"));
  if (!is_new) {
    tmc.contradiction("address", fmt::format("is {}, but must be another one: it is {} already, on "
                                             "the same port",
                                             chip.address, other->second));
  }
}

std::optional<TmcConfig> readTmc(ConfigReader& motor, std::optional<driver::DriverChip>& chip,
                                 UsedPorts& used) {
  motor.allow("tmc");
  if (!chip || !motor.has("tmc")) return {};
  if (driver::registerBusOf(*chip) == driver::RegisterBus::kNone) {
    motor.contradiction("tmc", fmt::format("is given, but is only for {}; the driver is the {}",
                                           listText(kChips, "and"), chip->title));
    return {};
  }
  chip = driver::registerChip(*chip);
  return TmcReader(motor, *chip).read(used);
}

namespace {

/// Reads a speed of the motor, which the chip compares with that of its steps.
class ChipSpeedReader {
 public:
  ChipSpeedReader(ConfigReader& motor, const AxisConfig& axis, tmc::Model model)
      : reader_(motor.map("tmc")), axis_(axis), model_(model) {}

  /// @param key_of its key, by the kind of the axis.
  /// @return [full steps/s]; empty if it isn't there, or is reported.
  std::optional<double> read(const char* (*key_of)(Kind)) {
    refuseOther(key_of);
    const char* const key = key_of(axis_.kind);
    const auto speed = reader_.findNumber(key, Range::positive(), Presence::kOptional);
    if (!speed) return {};
    const double least = tmc::lowestThreshold(model_) * fullStepTravel(axis_);
    const double most = tmc::highestThreshold(model_) * fullStepTravel(axis_);
    if (*speed >= least && *speed <= most) return *speed / fullStepTravel(axis_);
    reader_.issue(key,
                  fmt::format("is {}, but must be from {} to {}: the chip compares no other "
                              "speeds with this travel of a step",
                              reader_.shown(key), lowerBoundText(least), upperBoundText(most)));
    return {};
  }
  ConfigReader& reader() { return reader_; }

 private:
  void refuseOther(const char* (*key_of)(Kind)) {
    const char* const other = key_of(axis_.kind == Kind::kLinear ? Kind::kRotary : Kind::kLinear);
    if (!reader_.has(other)) return;
    reader_.contradiction(other, fmt::format("is {}, but the axis's speeds are in {}/s: give {}",
                                             reader_.shown(other), motionKeys(axis_.kind).unit,
                                             reader_.fullName(key_of(axis_.kind))));
  }

  ConfigReader reader_;
  const AxisConfig& axis_;
  const tmc::Model model_;
};

void readSpreadCycleAbove(ChipSpeedReader& speeds, const AxisConfig& axis, TmcConfig& tmc) {
  const auto above = speeds.read(aboveKey);
  if (!above) return;
  const char* const key = aboveKey(axis.kind);
  if (tmc.mode == ChopperMode::kSpreadCycle) {
    speeds.reader().contradiction(
        key, fmt::format("is {}, but is only for mode stealthchop: the mode is spreadcycle at each "
                         "speed",
                         speeds.reader().shown(key)));
    return;
  }
  tmc.spread_cycle_above = *above;
}

void readStallFaultAbove(ChipSpeedReader& speeds, const AxisConfig& axis, TmcConfig& tmc) {
  ConfigReader& reader = speeds.reader();
  const auto above = speeds.read(stallFaultKey);
  const char* const key = stallFaultKey(axis.kind);
  const auto needs = [&reader](const char* given, const char* missing) {
    reader.contradiction(given, fmt::format("is {}, but {} is missing", reader.shown(given),
                                            reader.fullName(missing)));
  };
  if (!tmc.stall_fault) {
    if (reader.has(key)) needs(key, "stall_fault_threshold");
    return;
  }
  if (!reader.has(key)) return needs("stall_fault_threshold", key);
  if (!above) return;
  tmc.stall_fault->above = *above;
  if (tmc.spread_cycle_above > 0.0 && *above >= tmc.spread_cycle_above) {
    reader.contradiction(key, fmt::format("is {}, but must be below {}: the chip detects stalls in "
                                          "stealthchop only",
                                          reader.shown(key), reader.fullName(aboveKey(axis.kind))));
  }
  if (*above * fullStepTravel(axis) >= axis.max_speed * motionKeys(axis.kind).units_per_si_unit) {
    reader.contradiction(key, fmt::format("is {}, but must be below the axis's highest speed: a "
                                          "stall would never be detected",
                                          reader.shown(key)));
  }
}

}  // namespace

void readTmcSpeeds(ConfigReader& motor, const AxisConfig& axis, const driver::DriverChip& chip,
                   TmcConfig& tmc) {
  ChipSpeedReader speeds(motor, axis, tmc::modelOf(chip.name));
  readSpreadCycleAbove(speeds, axis, tmc);
  readStallFaultAbove(speeds, axis, tmc);
}

ConfigValue::Map writeTmc(const TmcConfig& tmc, const AxisConfig& axis) {
  ConfigValue::Map map = writtenTmc(tmc);
  if (tmc.spread_cycle_above > 0.0) {
    map[aboveKey(axis.kind)] = tmc.spread_cycle_above * fullStepTravel(axis);
  }
  if (tmc.stall_fault) {
    map[stallFaultKey(axis.kind)] = tmc.stall_fault->above * fullStepTravel(axis);
  }
  return map;
}

}  // namespace stepdriver::config
