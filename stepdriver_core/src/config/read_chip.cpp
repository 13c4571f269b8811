#include "read_chip.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "message_text.h"

namespace stepdriver::config {
namespace {

using driver::DriverChip;
using driver::FaultEnd;
using driver::TranslatorState;

constexpr const char* kDescribed = "step_dir";
const std::vector<std::string> kLevels = {"low", "high"};
const std::vector<std::string> kLevelsOrNone = {"low", "high", "none"};
// The words in the order of StepInputs.
const std::vector<std::string> kStepInputs = {"step_dir", "cw_ccw", "phases"};
const std::vector<std::string> kStepEdges = {"one", "both"};
const std::vector<std::string> kFaultEnds = {"itself", "reset", "enable", "power"};
const std::vector<std::string> kStates = {"held", "counts", "home"};

constexpr double kNsPerUs = 1e3;
constexpr double kNsPerMs = 1e6;
constexpr double kLongestUs = 1e6;
constexpr double kLongestMs = 1e4;
// A nanosecond: a shorter pulse would be no pulse.
constexpr double kShortestPulseUs = 1e-3;

/// The part of a chip that needs a time: if a chip has that part, and the configuration alone
/// describes it, the time is required.
enum class Of { kSteps, kModes, kEnable, kSleep, kReset, kResetLow };

struct TimingKey {
  const char* key;
  std::int64_t driver::Timing::*time;
  double ns_per_unit;
  double min;
  double max;
  Of of;
};

constexpr std::array<TimingKey, 10> kTimingKeys{{
    {"step_high_us", &driver::Timing::step_high_ns, kNsPerUs, kShortestPulseUs, kLongestUs,
     Of::kSteps},
    {"step_low_us", &driver::Timing::step_low_ns, kNsPerUs, kShortestPulseUs, kLongestUs,
     Of::kSteps},
    {"dir_setup_us", &driver::Timing::dir_setup_ns, kNsPerUs, 0.0, kLongestUs, Of::kSteps},
    {"dir_hold_us", &driver::Timing::dir_hold_ns, kNsPerUs, 0.0, kLongestUs, Of::kSteps},
    {"mode_setup_us", &driver::Timing::mode_setup_ns, kNsPerUs, 0.0, kLongestUs, Of::kModes},
    {"mode_hold_us", &driver::Timing::mode_hold_ns, kNsPerUs, 0.0, kLongestUs, Of::kModes},
    {"enable_ms", &driver::Timing::enable_ns, kNsPerMs, 0.0, kLongestMs, Of::kEnable},
    {"wake_ms", &driver::Timing::wake_ns, kNsPerMs, 0.0, kLongestMs, Of::kSleep},
    {"reset_low_ms", &driver::Timing::reset_low_ns, kNsPerMs, 0.0, kLongestMs, Of::kResetLow},
    {"reset_wait_ms", &driver::Timing::reset_wait_ns, kNsPerMs, 0.0, kLongestMs, Of::kReset},
}};

/// The chip if the configuration says only `step_dir`.
DriverChip describedChip() {
  DriverChip chip;
  chip.name = kDescribed;
  chip.title = "step_dir driver";
  chip.opto_inputs = true;
  return chip;
}

std::string codeText(const DriverChip& chip, const driver::ModeCode& code) {
  std::string text;
  for (std::size_t pin = 0; pin < static_cast<std::size_t>(chip.mode_pins); ++pin) {
    text += code[pin] ? 'H' : 'L';
  }
  return text;
}

/// Takes modes from a text like "1 LLL, 2 HLL".
///
/// @return what is wrong with it, to continue "is ..., but"; empty: nothing.
std::string takeModes(const std::string& text, DriverChip& chip) {
  chip.modes.clear();
  std::string first;
  std::istringstream entries(text + ',');
  for (std::string entry; std::getline(entries, entry, ',');) {
    std::istringstream words(entry);
    driver::Mode mode{};
    std::string code;
    std::string rest;
    const bool complete = words >> mode.microsteps >> code && !(words >> rest);
    if (!complete || code.find_first_not_of("LH") != std::string::npos ||
        code.size() > driver::kMostModePins || mode.microsteps < 1 ||
        mode.microsteps > kFinestMicrosteps) {
      return "must be modes from 1 to 256 and their codes of one to three levels, L for low and H "
             "for high, as \"1 LLL, 2 HLL\"";
    }
    if (first.empty()) first = code;
    if (code.size() != first.size()) {
      return fmt::format(
          "must have codes of the same length: {} and {} are for different numbers "
          "of pins",
          first, code);
    }
    for (std::size_t pin = 0; pin < code.size(); ++pin) mode.code[pin] = code[pin] == 'H';
    chip.modes.push_back(mode);
  }
  chip.mode_pins = static_cast<int>(first.size());
  chip.microsteps = driver::selectableMicrosteps(chip);
  std::sort(chip.microsteps.begin(), chip.microsteps.end());
  return "";
}

/// What is wrong with the codes of a chip's modes, to continue "is ..., but"; empty: nothing.
std::string mistakeInModes(const DriverChip& chip) {
  for (std::size_t i = 0; i < chip.modes.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (chip.modes[k].code != chip.modes[i].code) continue;
      return fmt::format("must use each code once: {} selects {} and {} microsteps",
                         codeText(chip, chip.modes[i].code), chip.modes[k].microsteps,
                         chip.modes[i].microsteps);
    }
  }
  const std::vector<int> modes = driver::selectableMicrosteps(chip);
  for (const int from : modes) {
    for (const int to : modes) {
      if (driver::hasModePath(chip, from, to)) continue;
      return fmt::format(
          "must lead from each mode to each other one, one pin at a time and over its "
          "codes only: there is no way from {} to {} microsteps",
          from, to);
    }
  }
  return "";
}

/// What is wrong with a chip that a program has made, apart from what ChipReader checks.
std::string mistakeInChip(const DriverChip& chip) {
  const int pins = chip.mode_pins;
  if (pins < 0 || pins > static_cast<int>(driver::kMostModePins) ||
      (pins == 0) != chip.modes.empty()) {
    return fmt::format(
        "has {} modes and {} microstep pins; it must have 1 to {} pins for modes, or neither",
        chip.modes.size(), pins, driver::kMostModePins);
  }
  const auto possible = [](int microsteps) {
    return microsteps >= 1 && microsteps <= kFinestMicrosteps;
  };
  const std::vector<int> modes = driver::selectableMicrosteps(chip);
  if (!std::all_of(chip.microsteps.begin(), chip.microsteps.end(), possible) ||
      !std::all_of(modes.begin(), modes.end(), possible)) {
    return fmt::format("its modes must be from 1 to {} microsteps", kFinestMicrosteps);
  }
  const std::string mistake = mistakeInModes(chip);
  return mistake.empty() ? "" : "its codes " + mistake;
}

class ChipReader {
 public:
  ChipReader(ConfigReader& owner, const std::set<std::string>& pins, DriverChip& chip)
      : owner_(owner), pins_(pins), chip_(chip), reader_(owner.map("chip")) {}

  void read() {
    const bool wires_enable = isWired("enable");
    const auto inputs = reader_.findOneOf("step_inputs", kStepInputs, Presence::kOptional);
    if (inputs) {
      readStepInputs(*inputs);
    } else if (reader_.has("step_inputs") && isWired("cw")) {
      chip_.step_inputs = driver::StepInputs::kCwCcw;  // one mistake gives one message
    }
    const auto edges = reader_.findOneOf("step_edges", kStepEdges, Presence::kOptional);
    if (edges && hasPhases() && edges != "both") {
      reader_.contradiction("step_edges",
                            fmt::format("is {}, but must be both: each change of the coils that "
                                        "the {} switches is a step",
                                        reader_.shown("step_edges"), chip_.title));
    } else if (edges) {
      chip_.both_edges = edges == "both";
    }
    if (chip_.both_edges && chip_.step_inputs == driver::StepInputs::kCwCcw) {
      reader_.contradiction(
          edges ? "step_edges" : "step_inputs",
          fmt::format("is {}, but each edge can be a step only on a STEP input, not on CW and CCW",
                      reader_.shown(edges ? "step_edges" : "step_inputs")));
    }
    chip_.step_active = level("step_active", chip_.step_active);
    const bool wants_enable = isDescribed() && wires_enable && reader_.isMap();
    if (wants_enable) {
      const auto on = reader_.findOneOf("enable_active", kLevels, Presence::kRequired);
      chip_.enable_on = on == "high";
    } else {
      chip_.enable_on = level("enable_active", chip_.enable_on);
    }
    chip_.sleep_asleep = levelIfAny("sleep_active", chip_.sleep_asleep);
    chip_.reset_held = levelIfAny("reset_active", chip_.reset_held);
    chip_.fault_active = levelIfAny("fault_active", chip_.fault_active);
    readFaultEnd();
    chip_.in_position_active = levelIfAny("in_position_active", chip_.in_position_active);
    chip_.disabled = state("when_disabled", chip_.disabled);
    chip_.asleep = state("when_asleep", chip_.asleep);
    if (reader_.has("when_asleep") && !chip_.sleep_asleep) {
      reader_.contradiction(
          "when_asleep",
          fmt::format("is {}, but the {} has no SLEEP pin: {} is none",
                      reader_.shown("when_asleep"), chip_.title, reader_.fullName("sleep_active")));
    }
    readModes();
    reader_.rejectUnknown();
    readTiming(wires_enable);
  }

 private:
  bool isDescribed() const { return chip_.name == kDescribed; }

  bool hasPhases() const { return chip_.step_inputs == driver::StepInputs::kPhases; }

  void readStepInputs(const std::string& text) {
    const auto found = std::find(kStepInputs.begin(), kStepInputs.end(), text);
    const auto inputs = static_cast<driver::StepInputs>(found - kStepInputs.begin());
    if ((inputs == driver::StepInputs::kPhases) == hasPhases()) {
      chip_.step_inputs = inputs;
      return;
    }
    reader_.contradiction(
        "step_inputs",
        fmt::format("is {}, but the {} {}", reader_.shown("step_inputs"), chip_.title,
                    hasPhases() ? "switches the coils of its motor: it is phases"
                                : "takes pulses; a uln2003 has phases"));
  }

  bool isWired(const std::string& pin) const { return pins_.count(pin) > 0; }

  bool level(const std::string& key, bool of_chip) {
    return reader_.oneOf(key, kLevels, of_chip ? "high" : "low") == "high";
  }

  std::optional<bool> levelIfAny(const std::string& key, std::optional<bool> of_chip) {
    const auto text = reader_.findOneOf(key, kLevelsOrNone, Presence::kOptional);
    if (!text) return of_chip;
    if (text == "none") return {};
    return text == "high";
  }

  TranslatorState state(const std::string& key, TranslatorState of_chip) {
    const auto text = reader_.findOneOf(key, kStates, Presence::kOptional);
    if (text == "held") return TranslatorState::kHeld;
    if (text == "counts") return TranslatorState::kCounts;
    if (text == "home") return TranslatorState::kHome;
    return of_chip;
  }

  void readModes() {
    const auto text = reader_.findText("microstep_codes", Presence::kOptional);
    if (!text) return;
    DriverChip chip = chip_;
    std::string mistake = takeModes(*text, chip);
    if (mistake.empty()) mistake = mistakeInModes(chip);
    if (mistake.empty()) {
      chip_ = chip;
    } else {
      reader_.issue("microstep_codes",
                    fmt::format("is {}, but {}", reader_.shown("microstep_codes"), mistake));
    }
  }

  bool mustState(Of of, bool wires_enable) const {
    if (!isDescribed()) return false;
    switch (of) {
      case Of::kSteps:
        return true;
      case Of::kModes:
        return !chip_.modes.empty();
      case Of::kEnable:
        return wires_enable;
      case Of::kSleep:
        return chip_.sleep_asleep.has_value();
      case Of::kReset:
        return chip_.reset_held.has_value();
      case Of::kResetLow:
        return chip_.reset_held || (chip_.fault_active && chip_.fault_end == FaultEnd::kEnable);
    }
    return false;
  }

  void readFaultEnd() {
    const char* const key = "fault_ended_by";
    const bool must = isDescribed() && chip_.fault_active;
    const auto by =
        reader_.findOneOf(key, kFaultEnds, must ? Presence::kRequired : Presence::kOptional);
    if (!by) return;
    const auto found = std::find(kFaultEnds.begin(), kFaultEnds.end(), *by);
    chip_.fault_end = static_cast<FaultEnd>(found - kFaultEnds.begin());
    const auto without = [&](const char* pin, const char* level) {
      reader_.contradiction(
          key, fmt::format("is {}, but the {} has no {}: {} is none", reader_.shown(key),
                           chip_.title, pin, reader_.fullName(level)));
    };
    const auto* const level = reader_.value("fault_active").as<std::string>();
    const bool wrong = reader_.has("fault_active") && (level == nullptr || *level != "none");
    if (!chip_.fault_active && !wrong) {
      without("fault output", "fault_active");
    } else if (chip_.fault_end == FaultEnd::kReset && !chip_.reset_held) {
      without("RESET pin", "reset_active");
    }
  }

  void readTiming(bool wires_enable) {
    ConfigReader reader = owner_.map("timing");
    for (const TimingKey& key : kTimingKeys) {
      const auto presence =
          mustState(key.of, wires_enable) ? Presence::kRequired : Presence::kOptional;
      const auto time = reader.findNumber(key.key, {key.min, key.max}, presence);
      if (time) chip_.timing.*key.time = std::llround(*time * key.ns_per_unit);
    }
    reader.rejectUnknown();
  }

  ConfigReader& owner_;
  const std::set<std::string>& pins_;
  DriverChip& chip_;
  ConfigReader reader_;
};

}  // namespace

std::string stepInputsText(driver::StepInputs inputs) {
  return kStepInputs.at(static_cast<std::size_t>(inputs));
}

std::string faultEndText(FaultEnd end) { return kFaultEnds.at(static_cast<std::size_t>(end)); }

ConfigValue::Map writtenTiming(const driver::Timing& timing) {
  ConfigValue::Map map;
  for (const TimingKey& key : kTimingKeys) {
    map[key.key] = static_cast<double>(timing.*key.time) / key.ns_per_unit;
  }
  return map;
}

std::optional<DriverChip> readChip(ConfigReader& reader, const std::set<std::string>& pins,
                                   const OwnChips& own) {
  reader.allow("driver");
  const auto* name = reader.value("driver").as<std::string>();
  std::optional<DriverChip> chip;
  if (const auto found = own.find(name != nullptr ? *name : ""); found != own.end()) {
    chip = found->second;
    if (const std::string mistake = mistakeInChip(*chip); !mistake.empty()) {
      reader.issue("driver", fmt::format("is the {}, but {}", chip->title, mistake));
      return {};
    }
  } else if (name != nullptr && *name == kDescribed) {
    chip = describedChip();
  } else if (name != nullptr) {
    if (const DriverChip* known = driver::findDriverChip(*name)) chip = *known;
  }
  if (chip) {
    ChipReader(reader, pins, *chip).read();
    return chip;
  }
  std::vector<std::string> names = driver::driverChipNames();
  names.emplace_back(kDescribed);
  reader.findOneOf("driver", names, Presence::kRequired);
  // Errors in the maps are reported all the same.
  DriverChip unknown;
  ChipReader(reader, pins, unknown).read();
  return {};
}

}  // namespace stepdriver::config
