#include "read_pins.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/read_axes.h"
#include "message_text.h"

namespace stepdriver::config {
namespace {

struct PinName {
  const char* key;
  const char* from_0_key;  ///< on chips that count from M0; nullptr: the same
  Pin Pins::*pin;
};

constexpr std::array<PinName, 12> kPinNames{{{"step", nullptr, &Pins::step},
                                             {"dir", nullptr, &Pins::dir},
                                             {"enable", nullptr, &Pins::enable},
                                             {"ms1", "m0", &Pins::ms1},
                                             {"ms2", "m1", &Pins::ms2},
                                             {"ms3", "m2", &Pins::ms3},
                                             {"sleep", nullptr, &Pins::sleep},
                                             {"reset", nullptr, &Pins::reset},
                                             {"in1", nullptr, &Pins::in1},
                                             {"in2", nullptr, &Pins::in2},
                                             {"in3", nullptr, &Pins::in3},
                                             {"in4", nullptr, &Pins::in4}}};

bool isPulsePin(const PinName& name) { return name.pin == &Pins::step || name.pin == &Pins::dir; }

bool isCoilPin(const PinName& name) {
  return name.pin == &Pins::in1 || name.pin == &Pins::in2 || name.pin == &Pins::in3 ||
         name.pin == &Pins::in4;
}

std::string upperText(std::string key) {
  std::transform(key.begin(), key.end(), key.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::toupper(letter)); });
  return key;
}

/// The inputs that take its steps, in words.
const char* stepPinsText(const driver::DriverChip& chip) {
  switch (chip.step_inputs) {
    case driver::StepInputs::kStepDir:
      return "STEP and DIR";
    case driver::StepInputs::kCwCcw:
      return "CW and CCW";
    case driver::StepInputs::kPhases:
      break;
  }
  return "IN1 to IN4";
}

/// Its name on a driver with CW and CCW inputs.
const char* cwCcwKey(const PinName& name) { return name.pin == &Pins::step ? "cw" : "ccw"; }

bool isMicrostepPin(const PinName& name) { return name.from_0_key != nullptr; }

// The words in the order of Bias.
const std::vector<std::string> kBiases = {"as_is", "pull_up", "pull_down", "disabled"};

constexpr double kLongestSettlingMs = 60'000.0;
constexpr const char* kWantedLine = "a line: chip:offset, as \"gpiochip0:17\", or a line's name";

bool isLine(const std::string& line) {
  if (line.empty() || line.find_first_of(" \t\r\n\v\f") != std::string::npos) return false;
  const auto colon = line.rfind(':');
  if (colon == std::string::npos) return true;
  const std::string offset = line.substr(colon + 1);
  if (colon == 0 || offset.empty()) return false;
  // A pin of a board, as "mcu:gpio12" or "mcu:PA5". Whoever knows the boards checks its name.
  if (std::isalpha(static_cast<unsigned char>(offset.front())) != 0) {
    const bool is_numbered = std::isdigit(static_cast<unsigned char>(offset.back())) != 0;
    return is_numbered && std::all_of(offset.begin(), offset.end(), [](unsigned char letter) {
             return std::isalnum(letter) != 0 || letter == '_' || letter == '.';
           });
  }
  // Nine digits exceed the number of lines of any chip, and fit into an int.
  return offset.size() <= 9 && offset.find_first_not_of("0123456789") == std::string::npos;
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
  const std::string bias = reader.oneOf(key, kBiases, "as_is");
  return static_cast<Bias>(std::find(kBiases.begin(), kBiases.end(), bias) - kBiases.begin());
}

/// Why the chip has no such pin; empty if it has one.
std::string whyMissing(const driver::DriverChip& chip, const PinName& name, bool by_registers) {
  const std::string without = "the " + chip.title + " has no ";
  const bool has_phases = chip.step_inputs == driver::StepInputs::kPhases;
  if (isCoilPin(name) != has_phases) {
    return fmt::format("{}{} pin: it has {}", without, upperText(name.key), stepPinsText(chip));
  }
  if (isMicrostepPin(name) && chip.modes.empty()) {
    return without + (by_registers ? "microstep pins with `tmc`: MS1 and MS2 are its address"
                                   : "microstep pins: its microsteps are set by switches");
  }
  if (name.pin == &Pins::ms2 && chip.mode_pins < 2) return without + "second microstep pin";
  if (name.pin == &Pins::ms3 && chip.mode_pins < 3) return without + "third microstep pin";
  if (name.pin == &Pins::sleep && !chip.sleep_asleep) return without + "SLEEP pin";
  if (name.pin == &Pins::reset && !chip.reset_held) return without + "RESET pin";
  return {};
}

/// Reads the pins of one axis and remembers which of them were named, rightly or not: a mistake in
/// a pin is reported once, and not again as a pin that isn't wired.
class PinsReader {
 public:
  PinsReader(ConfigReader& axis, const driver::DriverChip* chip, UsedLines& used)
      : axis_(axis), chip_(chip), used_(used), reader_(axis.map("pins")) {}

  void read(MotorConfig& config) {
    for (const PinName& name : kPinNames) readPin(name);
    readFaultPin();
    readInPositionPin();
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
    config.fault_ramps = fault_ramps_;
    config.in_position = in_position_;
  }

 private:
  bool takesAliases() const {
    return chip_ == nullptr || chip_->mode_pins_from_0 || chip_->name == "step_dir";
  }

  bool hasPhases() const {
    return chip_ != nullptr && chip_->step_inputs == driver::StepInputs::kPhases;
  }

  /// Of a driver that isn't known.
  bool namesCoils() const { return chip_ == nullptr && reader_.has("in1"); }

  bool isCwCcw() const {
    return chip_ != nullptr && chip_->step_inputs == driver::StepInputs::kCwCcw;
  }

  /// Its name on this driver, which has no M0 to M2.
  const char* keyOf(const PinName& name) const {
    return isCwCcw() && isPulsePin(name) ? cwCcwKey(name) : name.key;
  }

  /// The name that the pin has on the other kind of drivers.
  void refuseOtherPulsePin(const PinName& name) {
    const char* const other = isCwCcw() ? name.key : cwCcwKey(name);
    if (!readLineName(reader_, other, Presence::kOptional) || chip_ == nullptr) return;
    reader_.contradiction(
        other,
        fmt::format("is {}, but the {} has {} inputs: give {}", reader_.shown(other), chip_->title,
                    stepPinsText(*chip_), reader_.fullName(hasPhases() ? "in1" : keyOf(name))));
  }

  bool isNamed(const PinName& name) const {
    return reader_.has(keyOf(name)) || (name.from_0_key && reader_.has(name.from_0_key));
  }

  void readPin(const PinName& name) {
    for (const char* key : {name.key, name.from_0_key}) {
      if (key != nullptr) reader_.allow(key);
    }
    if (isPulsePin(name)) refuseOtherPulsePin(name);
    if (chip_ != nullptr) {
      const std::string why = whyMissing(*chip_, name, axis_.has("tmc"));
      if (!why.empty()) return refuse(name, why);
    }
    const bool alias = name.from_0_key != nullptr && reader_.has(name.from_0_key);
    if (alias && !takesAliases()) {
      reader_.contradiction(name.from_0_key,
                            fmt::format("is {}, but the {} has no M0 to M2; on it the pin is {}",
                                        reader_.shown(name.from_0_key), chip_->title, name.key));
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
    const bool is_required = isCoilPin(name) ? hasPhases() : isPulsePin(name) && !namesCoils();
    const auto presence = is_required ? Presence::kRequired : Presence::kOptional;
    const auto line = readLine(reader_, alias ? name.from_0_key : keyOf(name), presence, used_);
    (pins_.*name.pin).line = line.value_or("");
  }

  void readFaultPin() {
    reader_.allow("fault");
    const Bias bias = readBias(axis_, "fault_bias");
    fault_ramps_ = axis_.oneOf("fault_stop", {"at_once", "ramp"}, "at_once") == "ramp";
    if (!reader_.has("fault")) {
      refuseWithout("fault", {"fault_bias"});
      if (!axis_.has("tmc")) refuseWithout("fault", {"fault_stop"});
      return;
    }
    if (chip_ != nullptr && !chip_->fault_active) {
      reader_.contradiction("fault", fmt::format("is {}, but the {} has no fault pin",
                                                 reader_.shown("fault"), chip_->title));
      return;
    }
    if (const auto line = readLine(reader_, "fault", Presence::kOptional, used_)) {
      fault_ = FaultPin{*line, bias};
    }
  }

  void readInPositionPin() {
    reader_.allow("in_position");
    InPositionPin pin;
    pin.bias = readBias(axis_, "in_position_bias");
    pin.timeout =
        axis_.number("in_position_timeout_ms", Range{0.0, kLongestSettlingMs, true}, 1000.0) / 1e3;
    if (!reader_.has("in_position")) {
      refuseWithout("in_position", {"in_position_bias", "in_position_timeout_ms"});
      return;
    }
    if (chip_ != nullptr && !chip_->in_position_active) {
      reader_.contradiction("in_position",
                            fmt::format("is {}, but the {} has no in-position output",
                                        reader_.shown("in_position"), chip_->title));
      return;
    }
    if (const auto line = readLine(reader_, "in_position", Presence::kOptional, used_)) {
      pin.line = *line;
      in_position_ = pin;
    }
  }

  /// Keys of the axis that say something about a pin that isn't wired.
  void refuseWithout(const char* pin, std::initializer_list<const char*> keys) {
    for (const char* key : keys) {
      if (!axis_.has(key)) continue;
      axis_.contradiction(key, fmt::format("is {}, but pins/{} is missing", axis_.shown(key), pin));
    }
  }

  void refuse(const PinName& name, const std::string& why) {
    for (const char* key : {name.key, name.from_0_key}) {
      if (key == nullptr || !readLineName(reader_, key, Presence::kOptional)) continue;
      reader_.contradiction(key, fmt::format("is {}, but {}", reader_.shown(key), why));
    }
  }

  static void refuseSecondName(ConfigReader& reader, const PinName& name) {
    reader.contradiction(name.from_0_key,
                         fmt::format("is {}, but {}, the same pin, is given too; give one",
                                     reader.shown(name.from_0_key), name.key));
  }

  void checkMicrostepPins() {
    if (chip_ != nullptr && chip_->modes.empty()) return;
    std::vector<std::string> named;
    std::vector<std::string> missing;
    const bool aliases =
        takesAliases() && (reader_.has("m0") || reader_.has("m1") || reader_.has("m2"));
    int pins = 0;
    for (const PinName& name : kPinNames) {
      if (!isMicrostepPin(name)) continue;
      if (chip_ != nullptr && ++pins > chip_->mode_pins) break;
      (isNamed(name) ? named : missing).emplace_back(aliases ? name.from_0_key : name.key);
    }
    if (named.empty() || missing.empty()) return;
    reader_.contradiction(
        missing.front(),
        fmt::format("is missing; wire {} microstep pins, or none if the board "
                    "is strapped to `microsteps` (wired: {})",
                    chip_ != nullptr && chip_->mode_pins == 2 ? "both" : "all three",
                    listText(named, "and")));
  }

  bool readCommonAnode() {
    if (!axis_.boolean("common_anode", false)) return false;
    if (chip_ == nullptr || chip_->opto_inputs) return true;
    axis_.contradiction(
        "common_anode",
        fmt::format("is true, but must be false on the {}: only inputs with optocouplers, such as "
                    "a tb6600's, are wired so; for single pins there is invert",
                    chip_->title));
    return false;
  }

  void readInversions(bool common_anode) {
    if (common_anode) {
      for (Pin* pin : {&pins_.step, &pins_.dir, &pins_.enable}) pin->inverted = pin->wired();
    }
    ConfigReader invert = axis_.map("invert");
    for (const PinName& name : kPinNames) {
      if (isPulsePin(name)) refuseOtherInversion(invert, name);
      readInversion(invert, keyOf(name), name, common_anode);
      const char* alias = name.from_0_key;
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

  void refuseOtherInversion(ConfigReader& invert, const PinName& name) {
    const char* const other = isCwCcw() ? name.key : cwCcwKey(name);
    if (!invert.findBoolean(other, Presence::kOptional) || chip_ == nullptr) return;
    invert.contradiction(
        other, fmt::format("is {}, but the {} has {} inputs{}", invert.shown(other), chip_->title,
                           stepPinsText(*chip_),
                           isCwCcw() ? ": to reverse the axis, swap pins/cw and pins/ccw" : ""));
  }

  void readInversion(ConfigReader& invert, const std::string& key, const PinName& name,
                     bool common_anode) {
    const auto inverted = invert.findBoolean(key, Presence::kOptional);
    if (!inverted) return;
    if (!isNamed(name)) {
      if ((isPulsePin(name) && !hasPhases()) || !reader_.isMap()) return;
      invert.contradiction(
          key, fmt::format("is {}, but only a wired pin may be named here; {} is missing",
                           invert.shown(key), reader_.fullName(key)));
      return;
    }
    const bool pulses = name.pin == &Pins::step || (name.pin == &Pins::dir && isCwCcw());
    if (common_anode && (pulses || name.pin == &Pins::enable)) {
      invert.contradiction(
          key, fmt::format("is {}, but common_anode inverts it already{}", invert.shown(key),
                           isCwCcw() ? ""
                                     : "; with common_anode only dir may be named here, to reverse "
                                       "the direction"));
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
  bool fault_ramps_ = false;
  std::optional<InPositionPin> in_position_;
};

}  // namespace

std::string biasText(Bias bias) { return kBiases.at(static_cast<std::size_t>(bias)); }

std::vector<std::pair<std::string, Pin>> pinsByKey(const MotorConfig& motor) {
  const bool is_cw_ccw = motor.driver.step_inputs == driver::StepInputs::kCwCcw;
  std::vector<std::pair<std::string, Pin>> pins;
  for (const PinName& name : kPinNames) {
    const bool other = is_cw_ccw && isPulsePin(name);
    pins.emplace_back(other ? cwCcwKey(name) : name.key, motor.pins.*name.pin);
  }
  return pins;
}

std::string readRequiredLine(ConfigReader& reader, const std::string& key, UsedLines& used) {
  return readLine(reader, key, Presence::kRequired, used).value_or("");
}

namespace {

/// All but its line.
InputSwitch readLevel(ConfigReader& reader) {
  InputSwitch input;
  input.active_level = reader.oneOf("active_level", {"low", "high"}) == "high";
  input.bias = readBias(reader, "bias");
  return input;
}

}  // namespace

InputSwitch readInputSwitch(ConfigReader& reader, UsedLines& used) {
  std::string line = readRequiredLine(reader, "pin", used);
  InputSwitch input = readLevel(reader);
  input.line = std::move(line);
  return input;
}

void readPins(ConfigReader& axis, const driver::DriverChip* chip, MotorConfig& config,
              UsedLines& used) {
  PinsReader(axis, chip, used).read(config);
}

void readBrake(ConfigReader& axis, bool pins_are_right, AxisConfig& config, UsedLines& used) {
  ConfigReader reader = axis.map("brake");
  if (!axis.has("brake")) return;
  constexpr Range kTimes{0.0, 10'000.0};  // [ms] far above any brake's
  BrakeConfig brake;
  brake.line = readRequiredLine(reader, "pin", used);
  brake.release_level = reader.oneOf("release_level", {"low", "high"}, "high") == "high";
  brake.release_ns = std::llround(reader.number("release_ms", kTimes) * 1e6);
  brake.engage_ns = std::llround(reader.number("engage_ms", kTimes) * 1e6);
  reader.rejectUnknown();
  config.brake = brake;
  if (!pins_are_right || config.hasSwitchedCurrent() || config.pins.sleep.wired()) return;
  axis.contradiction(
      "brake", fmt::format("is given, but needs {} or {}, and neither is wired: it follows the "
                           "motor's current, which nothing could switch",
                           axis.fullName("pins/enable"), axis.fullName("pins/sleep")));
}

void readEndstops(ConfigReader& axis, bool is_only, MotorConfig& config, UsedLines& used) {
  ConfigReader endstops = axis.map("endstops");
  const auto read = [&](const char* end) -> std::optional<Endstop> {
    ConfigReader reader = endstops.map(end);
    if (!endstops.has(end)) return {};
    Endstop endstop;
    endstop.shared = reader.boolean("shared", false);
    if (endstop.shared) {
      std::string line = readLineName(reader, "pin", Presence::kRequired).value_or("");
      static_cast<InputSwitch&>(endstop) = readLevel(reader);
      endstop.line = std::move(line);
      if (!endstop.line.empty()) used.addShared(reader.fullName("pin"), endstop);
    } else {
      static_cast<InputSwitch&>(endstop) = readInputSwitch(reader, used);
    }
    reader.rejectUnknown();
    return endstop;
  };
  config.endstop_min = read("min");
  config.endstop_max = read("max");
  if (!is_only) endstops.rejectUnknown();
}

}  // namespace stepdriver::config
