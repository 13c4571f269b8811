#include "read_tmc.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "driver/tmc_registers.h"
#include "message_text.h"
#include "stepdriver_core/driver/driver_chip.h"

namespace stepdriver::config {
namespace {

namespace tmc = driver::tmc;

const std::vector<std::string> kChips = {"tmc2208", "tmc2209", "tmc2226"};
const std::vector<std::string> kModes = {"stealthchop", "spreadcycle"};
// The chip measures the rate of each frame with its clock, up to 500 kbaud.
const std::vector<int> kBauds = {9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000};
constexpr int kMostAddress = 3;
// Boards have 50 to 150 mOhm; motors of less than 0.2 A have more.
constexpr Range kResistors{10.0, 1000.0};
constexpr double kMilliohm = 1e-3;
constexpr double kHalf = 0.5;
// Of a current that was written with its digits and read again.
constexpr double kRounded = 1e-9;

class TmcReader {
 public:
  TmcReader(ConfigReader& motor, const driver::DriverChip& chip)
      : reader_(motor.map("tmc")), chip_(chip) {}

  std::optional<TmcConfig> read(UsedPorts& used) {
    const std::size_t before = reader_.issues().size();
    TmcConfig config;
    const auto port = reader_.findText("port", Presence::kRequired);
    if (port && (port->empty() || port->front() != '/')) {
      reader_.issue("port", fmt::format("is {}, but must be the path of a serial port, such as "
                                        "\"/dev/serial0\"",
                                        reader_.shown("port")));
    }
    config.port = port.value_or("");
    config.baud = reader_.findOneOf("baud", kBauds, Presence::kOptional).value_or(config.baud);
    config.address = readAddress();
    const auto mode = reader_.findOneOf("mode", kModes, Presence::kOptional);
    config.mode = mode == kModes.back() ? ChopperMode::kSpreadCycle : ChopperMode::kStealthChop;
    config.interpolate = reader_.boolean("interpolate", config.interpolate);
    config.hold_delay =
        reader_.number("hold_delay_s", {0.0, tmc::longestHoldDelay()}, config.hold_delay);
    readCurrents(config);
    reader_.rejectUnknown();
    if (reader_.issues().size() != before) return {};
    used.add(reader_, config);
    if (reader_.issues().size() != before) return {};
    return config;
  }

 private:
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
    if (!resistor || !run) return;
    const double sense = *resistor * kMilliohm;
    config.sense_resistor = sense;
    config.run_current = *run;
    if (!isWithin("run_current_a", *run, tmc::lowestCurrent(sense), tmc::highestCurrent(sense))) {
      return;
    }
    const double least = tmc::lowestHold(*run, sense);
    config.hold_current = hold.value_or(std::max(*run * kHalf, least));
    isWithin("hold_current_a", config.hold_current, least, *run);
  }

  ConfigReader reader_;
  const driver::DriverChip& chip_;
};

}  // namespace

void UsedPorts::add(ConfigReader& tmc, const TmcConfig& chip) {
  Port& port = ports_[chip.port];
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
  if (!driver::hasUart(*chip)) {
    motor.contradiction("tmc", fmt::format("is given, but is only for {}; the driver is the {}",
                                           listText(kChips, "and"), chip->title));
    return {};
  }
  chip = driver::uartChip(*chip);
  return TmcReader(motor, *chip).read(used);
}

ConfigValue::Map writeTmc(const TmcConfig& tmc) {
  return {{"port", tmc.port},
          {"baud", tmc.baud},
          {"address", tmc.address},
          {"sense_resistor_mohm", tmc.sense_resistor / kMilliohm},
          {"run_current_a", tmc.run_current},
          {"hold_current_a", tmc.hold_current},
          {"hold_delay_s", tmc.hold_delay},
          {"mode", kModes.at(tmc.mode == ChopperMode::kSpreadCycle ? 1 : 0)},
          {"interpolate", tmc.interpolate}};
}

}  // namespace stepdriver::config
