#include "read_pins.h"

#include <fmt/format.h>

#include <array>
#include <optional>

#include "config/read_axes.h"
#include "message_text.h"

namespace stepdriver::config {
namespace {

struct PinName {
  const char* key;
  const char* drv8825_key;  ///< the DRV8825's own name for it; nullptr: the same
  Pin Pins::*pin;
};

constexpr std::array<PinName, 8> kPinNames{{{"step", nullptr, &Pins::step},
                                            {"dir", nullptr, &Pins::dir},
                                            {"enable", nullptr, &Pins::enable},
                                            {"ms1", "m0", &Pins::ms1},
                                            {"ms2", "m1", &Pins::ms2},
                                            {"ms3", "m2", &Pins::ms3},
                                            {"sleep", nullptr, &Pins::sleep},
                                            {"reset", nullptr, &Pins::reset}}};

bool isMicrostepPin(const PinName& name) { return name.drv8825_key != nullptr; }

bool isRequired(const PinName& name) { return name.pin == &Pins::step || name.pin == &Pins::dir; }

constexpr const char* kWantedLine = "a line: chip:offset, as \"gpiochip0:17\", or a line's name";

bool isLine(const std::string& line) {
  if (line.empty() || line.find_first_of(" \t\r\n\v\f") != std::string::npos) return false;
  const auto colon = line.rfind(':');
  if (colon == std::string::npos) return true;
  const std::string offset = line.substr(colon + 1);
  // Nine digits exceed the number of lines of any chip, and fit into an int.
  return colon > 0 && !offset.empty() && offset.size() <= 9 &&
         offset.find_first_not_of("0123456789") == std::string::npos;
}

std::optional<std::string> readLineName(ConfigReader& reader, const std::string& key,
                                        Presence presence) {
  auto line = reader.findText(key, presence, kWantedLine);
  if (!line) return {};
  if (!isLine(*line)) {
    reader.issue(key, fmt::format("is {}, but must be {}", reader.shown(key), kWantedLine));
    return {};
  }
  return line;
}

std::optional<std::string> readLine(ConfigReader& reader, const std::string& key, Presence presence,
                                    UsedLines& used) {
  auto line = readLineName(reader, key, presence);
  if (line) used.add(reader.fullName(key), *line);
  return line;
}

Bias readBias(ConfigReader& reader, const std::string& key) {
  static const std::map<std::string, Bias> biases = {{"as_is", Bias::kAsIs},
                                                     {"pull_up", Bias::kPullUp},
                                                     {"pull_down", Bias::kPullDown},
                                                     {"disabled", Bias::kDisabled}};
  return biases.at(reader.oneOf(key, {"as_is", "pull_up", "pull_down", "disabled"}, "as_is"));
}

/// Why the chip has no such pin; empty if it has one.
std::string whyMissing(const driver::DriverChip& chip, const PinName& name) {
  if (isMicrostepPin(name) && chip.modes.empty()) {
    return "the " + chip.title + " has no microstep pins: its microsteps are set by switches";
  }
  if (name.pin == &Pins::sleep && !chip.has_sleep) return "the " + chip.title + " has no SLEEP pin";
  if (name.pin == &Pins::reset && !chip.has_reset) return "the " + chip.title + " has no RESET pin";
  return {};
}

/// Reads the pins of one axis and remembers which of them were named, rightly or not: a mistake in
/// a pin is reported once, and not again as a pin that isn't wired.
class PinsReader {
 public:
  PinsReader(ConfigReader& axis, const driver::DriverChip* chip, UsedLines& used)
      : axis_(axis), chip_(chip), used_(used), reader_(axis.map("pins")) {}

  void read(AxisConfig& config) {
    for (const PinName& name : kPinNames) readPin(name);
    readFaultPin();
    reader_.rejectUnknown();
    checkMicrostepPins();
    const bool common_anode = readCommonAnode();
    readInversions(common_anode);
    if (pins_.enable.wired()) {
      std::optional<bool> on;
      if (chip_ != nullptr) on = chip_->enable_on != pins_.enable.inverted;
      used_.addEnable(reader_.fullName("enable"), pins_.enable.line, on);
    }
    config.pins = pins_;
    config.fault = fault_;
  }

 private:
  bool takesAliases() const { return chip_ == nullptr || chip_->model == driver::Model::kDrv8825; }

  bool isNamed(const PinName& name) const {
    return reader_.has(name.key) || (name.drv8825_key && reader_.has(name.drv8825_key));
  }

  void readPin(const PinName& name) {
    for (const char* key : {name.key, name.drv8825_key}) {
      if (key != nullptr) reader_.allow(key);
    }
    if (chip_ != nullptr) {
      const std::string why = whyMissing(*chip_, name);
      if (!why.empty()) return refuse(name, why);
    }
    const bool alias = name.drv8825_key != nullptr && reader_.has(name.drv8825_key);
    if (alias && !takesAliases()) {
      reader_.contradiction(
          name.drv8825_key,
          fmt::format("is {}, but that is a name on the DRV8825; on the {} the pin is {}",
                      reader_.shown(name.drv8825_key), chip_->title, name.key));
      return;
    }
    if (alias && reader_.has(name.key)) {
      refuseSecondName(reader_, name);
      return;
    }
    if (name.pin == &Pins::enable) {  // its level must be known before its line
      pins_.enable.line = readLineName(reader_, name.key, Presence::kOptional).value_or("");
      return;
    }
    const auto presence = isRequired(name) ? Presence::kRequired : Presence::kOptional;
    const auto line = readLine(reader_, alias ? name.drv8825_key : name.key, presence, used_);
    (pins_.*name.pin).line = line.value_or("");
  }

  void readFaultPin() {
    reader_.allow("fault");
    const Bias bias = readBias(axis_, "fault_bias");
    if (!reader_.has("fault")) {
      if (axis_.has("fault_bias")) {
        axis_.contradiction("fault_bias", fmt::format("is {}, but pins/fault is missing",
                                                      axis_.shown("fault_bias")));
      }
      return;
    }
    if (chip_ != nullptr && !chip_->has_fault) {
      reader_.contradiction("fault", fmt::format("is {}, but the {} has no fault pin",
                                                 reader_.shown("fault"), chip_->title));
      return;
    }
    if (const auto line = readLine(reader_, "fault", Presence::kOptional, used_)) {
      fault_ = FaultPin{*line, bias};
    }
  }

  void refuse(const PinName& name, const std::string& why) {
    for (const char* key : {name.key, name.drv8825_key}) {
      if (key == nullptr || !reader_.has(key)) continue;
      reader_.contradiction(key, fmt::format("is {}, but {}", reader_.shown(key), why));
    }
  }

  static void refuseSecondName(ConfigReader& reader, const PinName& name) {
    reader.contradiction(name.drv8825_key,
                         fmt::format("is {}, but {}, the same pin, is given too; give one",
                                     reader.shown(name.drv8825_key), name.key));
  }

  void checkMicrostepPins() {
    if (chip_ != nullptr && chip_->modes.empty()) return;
    std::vector<std::string> named;
    std::vector<std::string> missing;
    const bool aliases =
        takesAliases() && (reader_.has("m0") || reader_.has("m1") || reader_.has("m2"));
    for (const PinName& name : kPinNames) {
      if (!isMicrostepPin(name)) continue;
      (isNamed(name) ? named : missing).emplace_back(aliases ? name.drv8825_key : name.key);
    }
    if (named.empty() || missing.empty()) return;
    reader_.contradiction(
        missing.front(),
        fmt::format("is missing; wire all three microstep pins, or none if the board "
                    "is strapped to `microsteps` (wired: {})",
                    listText(named, "and")));
  }

  bool readCommonAnode() {
    if (!axis_.boolean("common_anode", false)) return false;
    if (chip_ == nullptr || chip_->model == driver::Model::kTb6600) return true;
    axis_.contradiction(
        "common_anode",
        fmt::format("is true, but must be false on the {}: only a tb6600 has inputs to be "
                    "wired so; for single pins there is invert",
                    chip_->title));
    return false;
  }

  void readInversions(bool common_anode) {
    if (common_anode) {
      for (Pin* pin : {&pins_.step, &pins_.dir, &pins_.enable}) pin->inverted = pin->wired();
    }
    ConfigReader invert = axis_.map("invert");
    for (const PinName& name : kPinNames) {
      readInversion(invert, name.key, name, common_anode);
      const char* alias = name.drv8825_key;
      if (alias == nullptr || !takesAliases()) continue;
      if (invert.has(alias) && invert.has(name.key)) {
        invert.allow(alias);
        refuseSecondName(invert, name);
      } else {
        readInversion(invert, alias, name, common_anode);
      }
    }
    invert.rejectUnknown();
  }

  void readInversion(ConfigReader& invert, const std::string& key, const PinName& name,
                     bool common_anode) {
    const auto inverted = invert.findBoolean(key, Presence::kOptional);
    if (!inverted) return;
    if (!isNamed(name)) {
      if (isRequired(name) || !reader_.isMap()) return;
      invert.contradiction(
          key, fmt::format("is {}, but only a wired pin may be named here; {} is missing",
                           invert.shown(key), reader_.fullName(key)));
      return;
    }
    if (common_anode && (name.pin == &Pins::step || name.pin == &Pins::enable)) {
      invert.contradiction(
          key, fmt::format("is {}, but common_anode inverts it already; with common_anode "
                           "only dir may be named here, to reverse the direction",
                           invert.shown(key)));
      return;
    }
    Pin& pin = pins_.*name.pin;
    pin.inverted = pin.inverted != *inverted;
  }

  ConfigReader& axis_;
  const driver::DriverChip* chip_;
  UsedLines& used_;
  ConfigReader reader_;
  Pins pins_;
  std::optional<FaultPin> fault_;
};

}  // namespace

std::optional<InputSwitch> readInputSwitch(ConfigReader& parent, const std::string& key,
                                           UsedLines& used) {
  ConfigReader reader = parent.map(key);
  if (!parent.has(key)) return {};
  InputSwitch input;
  input.line = readLine(reader, "pin", Presence::kRequired, used).value_or("");
  input.active_level = reader.oneOf("active_level", {"low", "high"}) == "high";
  input.bias = readBias(reader, "bias");
  reader.rejectUnknown();
  return input;
}

void readPins(ConfigReader& axis, const driver::DriverChip* chip, AxisConfig& config,
              UsedLines& used) {
  PinsReader(axis, chip, used).read(config);
}

void readEndstops(ConfigReader& axis, AxisConfig& config, UsedLines& used) {
  ConfigReader endstops = axis.map("endstops");
  config.endstop_min = readInputSwitch(endstops, "min", used);
  config.endstop_max = readInputSwitch(endstops, "max", used);
  endstops.rejectUnknown();
}

}  // namespace stepdriver::config
