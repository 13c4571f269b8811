#include "lines_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "gpio/pwm_channel.h"
#include "pwm_line.h"
#include "stepdriver_core/error.h"
#include "table.h"

namespace stepdriver::check {
namespace {

/// Reasons, and the lines that share them, in the order of their first lines.
class Reasons {
 public:
  /// @param message as thrown by findLine(): the line's name comes first.
  void add(const std::string& line, const std::string& message) {
    const std::string prefix = "Line " + line + ": ";
    const bool named = message.rfind(prefix, 0) == 0;
    addReason(named ? line : "", named ? message.substr(prefix.size()) : message);
  }

  std::string text() const {
    std::string all;
    for (const auto& [reason, lines] : reasons_) {
      all += "  ";
      if (!lines.empty()) all += lines + ": ";
      all += reason;
      all += '\n';
    }
    return all;
  }

 private:
  void addReason(const std::string& line, const std::string& reason) {
    for (auto& [known, lines] : reasons_) {
      if (known != reason || line.empty()) continue;
      lines += ", " + line;
      return;
    }
    reasons_.emplace_back(reason, line);
  }

  std::vector<std::pair<std::string, std::string>> reasons_;  // reason -> lines
};

std::string placeOf(const std::vector<gpio::ChipInfo>& chips, gpio::LineAddress address) {
  return fmt::format("{}:{}", chips[address.chip].name, address.offset);
}

std::string holderOf(const gpio::LineInfo& info) {
  if (!info.used) return "free";
  return info.consumer.empty() ? "held by the kernel" : "held by \"" + info.consumer + '"';
}

/// @param enables the indices of the ENABLE lines so far, which motors may share.
void addLines(const config::AxisConfig& axis, const config::MotorConfig& motor,
              std::vector<NamedLine>& lines, std::vector<std::size_t>& enables) {
  const std::string name = axis.name + "/" + (motor.motor.empty() ? "" : motor.motor + "/");
  const auto add = [&](const char* pin, const std::string& line) {
    if (!line.empty()) lines.push_back({name + pin, line});
  };
  const config::Pins& pins = motor.pins;
  const bool cw_ccw = axis.hasCwCcwInputs();
  add(cw_ccw ? "cw" : "step", pins.step.line);
  add(cw_ccw ? "ccw" : "dir", pins.dir.line);
  const auto shared = std::find_if(enables.begin(), enables.end(), [&](std::size_t i) {
    return lines[i].line == pins.enable.line;
  });
  if (shared != enables.end()) {
    lines[*shared].pin += ", " + name + "enable";
  } else if (pins.enable.wired()) {
    enables.push_back(lines.size());
    add("enable", pins.enable.line);
  }
  const bool numbered_from_0 = motor.driver.mode_pins_from_0;
  add(numbered_from_0 ? "m0" : "ms1", pins.ms1.line);
  add(numbered_from_0 ? "m1" : "ms2", pins.ms2.line);
  add(numbered_from_0 ? "m2" : "ms3", pins.ms3.line);
  add("sleep", pins.sleep.line);
  add("reset", pins.reset.line);
  add("in1", pins.in1.line);
  add("in2", pins.in2.line);
  add("in3", pins.in3.line);
  add("in4", pins.in4.line);
  if (motor.endstop_min) add("endstops/min", motor.endstop_min->line);
  if (motor.endstop_max) add("endstops/max", motor.endstop_max->line);
  if (motor.fault) add("fault", motor.fault->line);
  if (motor.in_position) add("in_position", motor.in_position->line);
}

}  // namespace

std::vector<NamedLine> linesOf(const std::vector<config::AxisConfig>& axes,
                               const machine::MachineOptions& machine) {
  std::vector<NamedLine> lines;
  std::vector<std::size_t> enables;
  for (const config::AxisConfig& axis : axes) {
    for (std::size_t i = 0; i < axis.motors(); ++i) addLines(axis, axis.motorAt(i), lines, enables);
    if (axis.brake) lines.push_back({axis.name + "/brake", axis.brake->line});
  }
  if (machine.emergency_stop) lines.push_back({"emergency_stop", machine.emergency_stop->line});
  if (const auto& power = machine.motor_power) {
    lines.push_back({"motor_power", power->line});
    if (power->feedback) lines.push_back({"motor_power/feedback", power->feedback->line});
  }
  for (const config::OutputConfig& output : machine.outputs) {
    lines.push_back({"outputs/" + output.name, output.line});
  }
  for (const config::InputConfig& input : machine.inputs) {
    lines.push_back({"inputs/" + input.name, input.line.line});
  }
  if (machine.heartbeat) lines.push_back({"heartbeat", machine.heartbeat->line});
  return lines;
}

std::string chipsText(const std::vector<gpio::ChipInfo>& chips) {
  if (chips.empty()) return "  This machine has no GPIO chip (no /dev/gpiochip*).\n";
  std::vector<std::vector<std::string>> rows = {{"chip", "label", "lines"}};
  std::string remedy;
  for (const gpio::ChipInfo& chip : chips) {
    if (chip.error == 0) {
      rows.push_back({chip.name, chip.label, std::to_string(chip.lines.size())});
    } else {
      rows.push_back({chip.name, "can't be opened: " + gpio::errorText(chip.error)});
      remedy = gpio::remedyFor(chip.error);
    }
  }
  return table(rows) + (remedy.empty() ? "" : " " + remedy + "\n");
}

LinesReport linesReport(const std::vector<gpio::ChipInfo>& chips,
                        const std::vector<NamedLine>& lines, const std::string& pwm_folder) {
  LinesReport report;
  Reasons reasons;
  std::map<std::string, std::string> users;  // place -> pin
  std::vector<std::vector<std::string>> rows = {{"pin", "line", "found at", "state"}};
  for (const auto& [pin, line] : lines) {
    if (const auto pwm = pwmLineOf(line)) {
      const std::string why = gpio::PwmChannel::whyMissing(pwm_folder, *pwm);
      rows.push_back({pin, pwm->name(), why.empty() ? pwm_folder : "not found", "PWM"});
      if (why.empty()) continue;
      reasons.add(pwm->name(), why);
      ++report.missing;
      continue;
    }
    try {
      const gpio::LineAddress address = gpio::findLine(chips, line);
      const gpio::LineInfo& info = chips[address.chip].lines[address.offset];
      const std::string place = placeOf(chips, address);
      const auto [user, is_new] = users.emplace(place, pin);
      rows.push_back(
          {pin, line, place, is_new ? holderOf(info) : "the same line as " + user->second});
      if (is_new && !info.used) continue;
      reasons.add(line, "Line " + gpio::describe(chips, line, address) +
                            (is_new ? gpio::busyText(info)
                                    : " is named twice. Each pin needs a line of its own."));
    } catch (const GpioError& error) {
      rows.push_back({pin, line, "not found"});
      reasons.add(line, error.what());
    }
    ++report.missing;
  }
  report.text = table(rows) + reasons.text();
  return report;
}

}  // namespace stepdriver::check
