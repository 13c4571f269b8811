#pragma once

#include <string>
#include <vector>

#include "driver_view.h"
#include "held_jog.h"
#include "keys.h"
#include "messages.h"

namespace stepdriver::console {

/// A call of one of the driver's services.
struct Call {
  enum class What { kEnable, kDisable, kStep, kHome, kHomeAll, kStop, kRecover };

  What what = What::kStop;
  std::string axis;       ///< empty: all
  double distance = 0.0;  ///< [m|rad] of a step

  /// What it is, in words: `x: home`. There is one of a name under way at a time.
  std::string name() const;
};

/// What is to be sent to the driver now.
struct Orders {
  bool emergency_stop = false;
  std::vector<Call> calls;
  std::vector<HeldJog::Order> jogs;
};

/// How fast a jog is, as a part of the axis's highest speed.
struct JogSpeeds {
  double slow = 0.05;
  double fast = 0.5;
};

/// What the person at the keys wants, and what came of it: everything of the console that is
/// neither ROS nor a terminal. It knows no clock: times are seconds on any that never goes back.
///
/// Nothing but a key moves an axis, and no key moves one that isn't enabled, or whose state isn't
/// live. Stops and the emergency stop are sent whatever the state is.
class Session {
 public:
  enum class Emergency { kNone, kSent, kStopped, kFailed };

  struct PendingCall {
    Call call;
    double since = 0.0;
  };

  /// @param driver full name of the node.
  Session(std::string driver, JogSpeeds speeds) : name_(std::move(driver)), speeds_(speeds) {}

  /// All keys that have come since the last time. An emergency stop among them comes first, and
  /// what else there is is dropped.
  Orders press(const std::vector<Key>& keys, double now);
  /// What time alone brings. To be called often.
  Orders tick(double now);
  /// Ends the jog, where one is under way.
  Orders rest();

  void answered(const Call& call, bool success, const std::string& message);
  void emergencyAnswered(bool success, const std::string& message);
  /// The states of the axes, as of DriverView.
  void update(std::vector<AxisView> axes, double now);

  DriverView& driver() { return driver_; }
  const DriverView& driver() const { return driver_; }
  Messages& messages() { return messages_; }
  const Messages& messages() const { return messages_; }
  HeldJog& jog() { return jog_; }

  const std::string& driverName() const { return name_; }
  /// The axis that the keys are for; empty where there is none.
  const std::string& chosen() const { return chosen_; }
  const std::vector<PendingCall>& pending() const { return pending_; }
  Emergency emergency() const { return emergency_; }
  double emergencySince() const { return emergency_since_; }
  const std::string& emergencyMessage() const { return emergency_message_; }
  bool showsHelp() const { return help_; }
  bool ended() const { return ended_; }

 private:
  void obey(const Command& command, double now, Orders& orders);
  void choose(int step);
  void jogBy(const Command& command, double now, Orders& orders);
  void stepBy(int direction, double now, Orders& orders);
  /// Why the chosen axis must not be moved; empty: it may.
  std::string hindrance(double now) const;
  void endJog(Orders& orders);
  void call(Call call, double now, Orders& orders);

  const std::string name_;
  const JogSpeeds speeds_;
  DriverView driver_;
  Messages messages_;
  HeldJog jog_;
  std::string chosen_;
  std::vector<PendingCall> pending_;
  Emergency emergency_ = Emergency::kNone;
  double emergency_since_ = 0.0;
  std::string emergency_message_;
  bool emergency_seen_ = false;  // in the driver's state
  bool help_ = false;
  bool ended_ = false;
};

}  // namespace stepdriver::console
