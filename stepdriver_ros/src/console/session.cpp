#include "session.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/text.h"
#include "table_units.h"

namespace stepdriver::console {
namespace {

// [mm|deg] 0: one step of the motor, the smallest one.
constexpr std::array<double, 4> kStepSizes{0.0, 0.1, 1.0, 10.0};

// [%] The driver allows 1 to 200.
constexpr int kOverrideStep = 10;
constexpr int kSlowest = 10;
constexpr int kFastest = 200;

/// The positions that the limits of the axis allow: "0.0000 mm to 200.0000 mm"; empty: any.
std::string rangeText(const config::AxisConfig& config) {
  const double units = config::configUnitsPerUnit(config.kind);
  const auto shown = [&](double limit) {
    return positionText(limit * units, configUnitOf(config.kind));
  };
  const auto& min = config.min_position;
  const auto& max = config.max_position;
  if (min && max) return shown(*min) + " to " + shown(*max);
  if (min) return shown(*min) + " and above";
  if (max) return shown(*max) + " and below";
  return {};
}

/// @param position [m|rad]
bool isWithinLimits(const config::AxisConfig& config, double position) {
  // The driver rounds to a step, too.
  const double half_step = 0.5 / config.steps_per_unit;
  return position >= config.min_position.value_or(position) - half_step &&
         position <= config.max_position.value_or(position) + half_step;
}

}  // namespace

std::string Call::name() const {
  const auto word = [this] {
    switch (what) {
      case What::kEnable:
        return "enable";
      case What::kDisable:
        return "disable";
      case What::kStep:
        return "step";
      case What::kGoTo:
        return "go to";
      case What::kSetZero:
        return "set zero";
      case What::kHome:
      case What::kHomeAll:
        return "home";
      case What::kSetOutput:
        return "switch";
      case What::kEndCompare:
        return "end position compare";
      case What::kHold:
        return "hold";
      case What::kResume:
        return "resume";
      case What::kSpeedOverride:
        return "speed override";
      case What::kStop:
        return "stop";
      case What::kRecover:
        break;
    }
    return "recover";
  };
  if (!output.empty()) return output + ": " + word();
  return (axis.empty() ? "all axes" : axis) + ": " + word();
}

void StepSize::next() { index_ = (index_ + 1) % static_cast<int>(kStepSizes.size()); }

std::optional<double> StepSize::distance() const {
  if (kStepSizes[index_] == 0.0) return {};
  return kStepSizes[index_];
}

std::string StepSize::text(const std::string& unit) const {
  const auto size = distance();
  return size ? fmt::format("{} {}", ros_node::roundedText(*size), unit) : "one motor step";
}

Orders Session::press(const std::vector<Key>& keys, double now) {
  Orders orders;
  const auto stops = [](Key key) {
    const auto command = commandOf(key);
    return command && command->action == Action::kEmergencyStop;
  };
  if (std::any_of(keys.begin(), keys.end(), stops)) {
    obey({Action::kEmergencyStop}, now, orders);
    return orders;
  }
  for (const Key key : keys) {
    if (prompt_) {
      typeInto(key, now, orders);
    } else if (zero_asked_) {
      answerZero(key, now, orders);
    } else if (isLeftOver(key)) {
      continue;
    } else if (const auto command = commandOf(key)) {
      obey(*command, now, orders);
    }
  }
  return orders;
}

Orders Session::tick(double now) {
  Orders orders;
  if (!driver_.live(now)) override_.reset();  // it may be another driver afterwards
  if (jog_.active() && !driver_.live(now)) {
    messages_.say(jog_.axis() + ": the jog ends because the driver's state isn't live");
    endJog(orders);
  }
  if (const auto order = jog_.due(now)) orders.jogs.push_back(*order);
  return orders;
}

Orders Session::rest() {
  Orders orders;
  endJog(orders);
  return orders;
}

void Session::obey(const Command& command, double now, Orders& orders) {
  if (command.action != Action::kJog) endJog(orders);
  switch (command.action) {
    case Action::kEmergencyStop:
      orders.emergency_stop = true;
      emergency_ = Emergency::kSent;
      emergency_since_ = now;
      emergency_seen_ = false;
      closeDialogues();
      break;
    case Action::kStop:
      call({Call::What::kStop, {}}, now, orders);
      break;
    case Action::kRecover:
      call({Call::What::kRecover, {}}, now, orders);
      break;
    case Action::kPreviousAxis:
      choose(-1);
      break;
    case Action::kNextAxis:
      choose(1);
      break;
    case Action::kChooseAxis:
      if (command.index < static_cast<int>(driver_.axes().size())) {
        chosen_ = driver_.axes()[command.index].name;
      }
      break;
    case Action::kJog:
      jogBy(command, now, orders);
      break;
    case Action::kStep:
      stepBy(command.direction, now, orders);
      break;
    case Action::kStepSize:
      step_size_.next();
      break;
    case Action::kGoTo:
      openPrompt(now);
      break;
    case Action::kSetZero:
      askForZero(now);
      break;
    case Action::kHold:
      call({Call::What::kHold, {}}, now, orders);
      break;
    case Action::kResume:
      resume(now, orders);
      break;
    case Action::kSlower:
    case Action::kFaster:
      changeOverride(command.action == Action::kSlower ? -1 : 1, now, orders);
      break;
    case Action::kEnable:
      if (!chosen_.empty()) call({Call::What::kEnable, chosen_}, now, orders);
      break;
    case Action::kDisable:
      if (!chosen_.empty()) call({Call::What::kDisable, chosen_}, now, orders);
      break;
    case Action::kEnableAll:
      call({Call::What::kEnable, {}}, now, orders);
      break;
    case Action::kDisableAll:
      call({Call::What::kDisable, {}}, now, orders);
      break;
    case Action::kHome:
    case Action::kHomeAll:
      home(command.action == Action::kHomeAll, now, orders);
      break;
    case Action::kNextOutput:
      chooseNextOutput();
      break;
    case Action::kSwitchOutput:
      switchOutput(now, orders);
      break;
    case Action::kEndCompare:
      endCompare(now, orders);
      break;
    case Action::kHelp:
      help_ = !help_;
      break;
    case Action::kQuit:
      ended_ = true;
      break;
  }
}

void Session::choose(int step) {
  const auto& axes = driver_.axes();
  if (axes.empty()) return;
  const auto found = std::find_if(axes.begin(), axes.end(),
                                  [this](const AxisView& axis) { return axis.name == chosen_; });
  const auto count = static_cast<int>(axes.size());
  const int now = found == axes.end() ? 0 : static_cast<int>(found - axes.begin());
  chosen_ = axes[(now + step + count) % count].name;
}

std::string Session::hindrance(const std::string& name, double now) const {
  if (name.empty()) return "nothing is moved: the driver has not sent its axes yet";
  const AxisView* axis = driver_.axis(name);
  if (!driver_.live(now) || axis == nullptr) {
    return name + " isn't moved: the driver's state isn't live";
  }
  if (driver_.config(name) == nullptr) {
    return name + " isn't moved: the console has not read its configuration";
  }
  if (!axis->fault.empty()) return name + " isn't moved: it has a fault; r recovers";
  if (!axis->enabled) return name + " isn't moved: it isn't enabled; e enables it";
  if (axis->held) return name + " isn't moved: it is on hold; c resumes, s stops";
  return {};
}

void Session::home(bool all, double now, Orders& orders) {
  const std::string why = hindrance(chosen_, now);
  if (!all && !why.empty()) {
    messages_.say(why);
  } else if (!driver_.live(now)) {
    messages_.say("no axis is homed: the driver's state isn't live");
  } else {
    call({all ? Call::What::kHomeAll : Call::What::kHome, all ? "" : chosen_}, now, orders);
  }
}

const OutputView* Session::chosenOutput() const {
  const std::vector<OutputView>& outputs = driver_.outputs();
  const auto found = std::find_if(outputs.begin(), outputs.end(), [this](const OutputView& output) {
    return output.name == chosen_output_;
  });
  if (found != outputs.end()) return &*found;
  return outputs.empty() ? nullptr : &outputs.front();
}

void Session::chooseNextOutput() {
  const OutputView* const chosen = chosenOutput();
  if (chosen == nullptr) return messages_.say("the driver has no output with a name");
  const std::vector<OutputView>& outputs = driver_.outputs();
  const auto index = static_cast<std::size_t>(chosen - outputs.data());
  chosen_output_ = outputs[(index + 1) % outputs.size()].name;
}

void Session::switchOutput(double now, Orders& orders) {
  const OutputView* const chosen = chosenOutput();
  if (chosen == nullptr) return messages_.say("the driver has no output with a name");
  if (!driver_.live(now)) {
    return messages_.say(chosen->name + " isn't switched: the driver's state isn't live");
  }
  Call change{Call::What::kSetOutput, {}};
  change.output = chosen->name;
  change.on = !chosen->on;
  call(std::move(change), now, orders);
}

void Session::endCompare(double now, Orders& orders) {
  const OutputView* const chosen = chosenOutput();
  if (chosen == nullptr) return messages_.say("the driver has no output with a name");
  if (!driver_.live(now)) {
    return messages_.say(chosen->name + " isn't changed: the driver's state isn't live");
  }
  if (chosen->axis.empty()) {
    return messages_.say(chosen->name + " isn't changed: no position switches it");
  }
  Call change{Call::What::kEndCompare, {}};
  change.output = chosen->name;
  call(std::move(change), now, orders);
}

void Session::openPrompt(double now) {
  const std::string why = hindrance(chosen_, now);
  if (why.empty()) {
    prompt_.emplace(chosen_);
  } else {
    messages_.say(why);
    closed_prompt_ = ClosedPrompt{chosen_};
  }
}

void Session::closeDialogues() {
  if (prompt_) closed_prompt_ = ClosedPrompt{prompt_->axis(), !prompt_->text().empty()};
  prompt_.reset();
  zero_asked_.reset();
}

bool Session::isLeftOver(Key key) {
  if (!closed_prompt_ || key == 's' || key == kKeyCtrlC) return false;
  if (key == kKeyEnter || key == kKeyEscape) {
    closed_prompt_.reset();
    return true;
  }
  closed_prompt_->typed = closed_prompt_->typed || PositionPrompt::takes(key);
  if (closed_prompt_->typed) return true;
  closed_prompt_.reset();
  return false;
}

bool Session::leavesDialogue(Key key, double now, Orders& orders) {
  if (key != 's' && key != kKeyCtrlC) return false;
  closeDialogues();
  obey(*commandOf(key), now, orders);
  return true;
}

void Session::typeInto(Key key, double now, Orders& orders) {
  if (leavesDialogue(key, now, orders)) return;
  switch (prompt_->press(key)) {
    case PositionPrompt::Outcome::kOpen:
      break;
    case PositionPrompt::Outcome::kCancelled:
      prompt_.reset();
      break;
    case PositionPrompt::Outcome::kEntered:
      goToTyped(now, orders);
      break;
  }
}

void Session::goToTyped(double now, Orders& orders) {
  const PositionPrompt typed = *prompt_;
  prompt_.reset();
  // If it is refused, the user may type again, as into an open prompt.
  closed_prompt_ = ClosedPrompt{typed.axis()};
  const std::string why = hindrance(typed.axis(), now);
  if (!why.empty()) {
    messages_.say(why);
    return;
  }
  const config::AxisConfig& config = *driver_.config(typed.axis());
  const std::string unit = configUnitOf(config.kind);
  const std::string range = rangeText(config);
  const auto number = typed.number();
  if (!number) {
    messages_.say(fmt::format("{} isn't moved: \"{}\" isn't a number in {}{}", typed.axis(),
                              typed.text(), unit, range.empty() ? "" : ", from " + range));
    return;
  }
  const double position = *number / config::configUnitsPerUnit(config.kind);
  if (!isWithinLimits(config, position)) {
    messages_.say(fmt::format("{} isn't moved: {} is outside its limits, {}", typed.axis(),
                              positionText(*number, unit), range));
    return;
  }
  closed_prompt_.reset();
  Call go{Call::What::kGoTo, typed.axis()};
  go.position = position;
  call(std::move(go), now, orders);
}

bool Session::mayBeZeroed(const std::string& name, double now) {
  const AxisView* axis = driver_.axis(name);
  if (!driver_.live(now) || axis == nullptr || driver_.config(name) == nullptr) {
    messages_.say("no position is set: the driver's state isn't live");
    return false;
  }
  if (axis->moving) {
    messages_.say(name + ": the position isn't set because the axis is moving; s stops it");
    return false;
  }
  return true;
}

void Session::askForZero(double now) {
  if (mayBeZeroed(chosen_, now)) zero_asked_ = chosen_;
}

void Session::answerZero(Key key, double now, Orders& orders) {
  if (leavesDialogue(key, now, orders)) return;
  const std::string axis = *zero_asked_;
  zero_asked_.reset();
  if (key != 'y') {
    messages_.say(axis + ": its position stays as it is");
  } else if (mayBeZeroed(axis, now)) {
    call({Call::What::kSetZero, axis}, now, orders);
  }
}

void Session::resume(double now, Orders& orders) {
  if (driver_.live(now)) {
    call({Call::What::kResume, {}}, now, orders);
  } else {
    messages_.say("nothing is resumed: the driver's state isn't live");
  }
}

void Session::changeOverride(int direction, double now, Orders& orders) {
  if (!override_) {
    messages_.say("the override isn't changed: the driver's state isn't live");
    return;
  }
  const int before = static_cast<int>(std::lround(*override_ * 100.0));
  const int wanted = before + direction * kOverrideStep;
  if (wanted < kSlowest || wanted > kFastest) {
    messages_.say(fmt::format("the override stays at {} %: it can be {} to {} %", before, kSlowest,
                              kFastest));
    return;
  }
  Call change{Call::What::kSpeedOverride, {}};
  change.factor = wanted / 100.0;
  call(std::move(change), now, orders);
}

void Session::jogBy(const Command& command, double now, Orders& orders) {
  const std::string why = hindrance(chosen_, now);
  if (!why.empty()) {
    endJog(orders);
    messages_.say(why);
    return;
  }
  if (jog_.active() && jog_.axis() != chosen_) endJog(orders);
  const config::AxisConfig& config = *driver_.config(chosen_);
  const double part = command.speed == JogSpeed::kSlow ? speeds_.slow : speeds_.fast;
  const double speed = config.max_speed * config::configUnitsPerUnit(config.kind) * part;
  jog_.press(chosen_, command.direction * speed, now);
}

void Session::stepBy(int direction, double now, Orders& orders) {
  const std::string why = hindrance(chosen_, now);
  if (!why.empty()) {
    messages_.say(why);
    return;
  }
  const config::AxisConfig& config = *driver_.config(chosen_);
  const double step = step_size_.distance().value_or(stepOf(config, *driver_.axis(chosen_)));
  call({Call::What::kStep, chosen_, direction * step / config::configUnitsPerUnit(config.kind)},
       now, orders);
}

void Session::endJog(Orders& orders) {
  if (const auto order = jog_.end()) orders.jogs.push_back(*order);
}

void Session::call(Call call, double now, Orders& orders) {
  const std::string name = call.name();
  if (std::any_of(pending_.begin(), pending_.end(),
                  [&](const PendingCall& one) { return one.call.name() == name; })) {
    messages_.say(name + ": not sent again, because the driver has not answered the last one yet");
    return;
  }
  pending_.push_back({call, now});
  orders.calls.push_back(std::move(call));
}

void Session::answered(const Call& call, bool success, const std::string& message) {
  const std::string name = call.name();
  pending_.erase(std::remove_if(pending_.begin(), pending_.end(),
                                [&](const PendingCall& one) { return one.call.name() == name; }),
                 pending_.end());
  const std::string shown = inTableUnits(message);
  messages_.say(success ? shown : fmt::format("{} REFUSED: {}", name, shown));
  if (success && call.what == Call::What::kSpeedOverride) override_ = call.factor;
  if (success && call.what == Call::What::kRecover && emergency_ != Emergency::kSent) {
    emergency_ = Emergency::kNone;
  }
}

void Session::logged(const std::string& text) { messages_.say(inTableUnits(text)); }

void Session::emergencyAnswered(bool success, const std::string& message) {
  emergency_ = success ? Emergency::kStopped : Emergency::kFailed;
  emergency_message_ = message;
}

void Session::update(std::vector<AxisView> axes, double now) {
  for (AxisView& axis : axes) axis.fault = inTableUnits(axis.fault);
  if (!axes.empty()) override_ = axes.front().speed_override;
  driver_.update(std::move(axes), now);
  if (driver_.axis(chosen_) == nullptr) {
    chosen_ = driver_.axes().empty() ? std::string() : driver_.axes().front().name;
  }
  if (emergency_ != Emergency::kStopped) return;
  // Ended by any client's recover().
  emergency_seen_ = emergency_seen_ || driver_.anyFault();
  if (emergency_seen_ && !driver_.anyFault()) emergency_ = Emergency::kNone;
}

}  // namespace stepdriver::console
