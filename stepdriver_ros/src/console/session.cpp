#include "session.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace stepdriver::console {

std::string Call::name() const {
  const auto word = [this] {
    switch (what) {
      case What::kEnable:
        return "enable";
      case What::kDisable:
        return "disable";
      case What::kStep:
        return "step";
      case What::kHome:
      case What::kHomeAll:
        return "home";
      case What::kStop:
        return "stop";
      case What::kRecover:
        break;
    }
    return "recover";
  };
  return (axis.empty() ? "all axes" : axis) + ": " + word();
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
    if (const auto command = commandOf(key)) obey(*command, now, orders);
  }
  return orders;
}

Orders Session::tick(double now) {
  Orders orders;
  if (jog_.active() && !driver_.live(now)) {
    messages_.say(jog_.axis() + ": the jog ends: the driver's state isn't live");
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
    case Action::kEnable:
      if (!chosen_.empty()) call({Call::What::kEnable, chosen_}, now, orders);
      break;
    case Action::kDisable:
      if (!chosen_.empty()) call({Call::What::kDisable, chosen_}, now, orders);
      break;
    case Action::kHome:
    case Action::kHomeAll: {
      const bool all = command.action == Action::kHomeAll;
      const std::string why = hindrance(now);
      if (!all && !why.empty()) {
        messages_.say(why);
      } else if (!driver_.live(now)) {
        messages_.say("not homed: the driver's state isn't live");
      } else {
        call({all ? Call::What::kHomeAll : Call::What::kHome, all ? "" : chosen_}, now, orders);
      }
      break;
    }
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

std::string Session::hindrance(double now) const {
  if (chosen_.empty()) return "no axis is known yet";
  const AxisView* axis = driver_.axis(chosen_);
  if (!driver_.live(now) || axis == nullptr) {
    return chosen_ + " isn't moved: the driver's state isn't live";
  }
  if (driver_.config(chosen_) == nullptr) {
    return chosen_ + " isn't moved: its configuration isn't known";
  }
  if (!axis->fault.empty()) return chosen_ + " isn't moved: it has a fault; r recovers";
  if (!axis->enabled) return chosen_ + " isn't moved: it isn't enabled; e enables it";
  return {};
}

void Session::jogBy(const Command& command, double now, Orders& orders) {
  const std::string why = hindrance(now);
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
  const std::string why = hindrance(now);
  if (!why.empty()) {
    messages_.say(why);
    return;
  }
  const config::AxisConfig& config = *driver_.config(chosen_);
  const double step = stepOf(config, *driver_.axis(chosen_));
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
    messages_.say(name + ": not sent again, the one before it has no answer yet");
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
  messages_.say(success ? message : fmt::format("{} REFUSED: {}", name, message));
  if (success && call.what == Call::What::kRecover && emergency_ != Emergency::kSent) {
    emergency_ = Emergency::kNone;
  }
}

void Session::emergencyAnswered(bool success, const std::string& message) {
  emergency_ = success ? Emergency::kStopped : Emergency::kFailed;
  emergency_message_ = message;
}

void Session::update(std::vector<AxisView> axes, double now) {
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
