#pragma once

#include <optional>
#include <string>
#include <vector>

#include "driver_view.h"
#include "held_jog.h"
#include "keys.h"
#include "messages.h"
#include "position_prompt.h"

namespace stepdriver::console {

/// A call of one of the driver's services.
struct Call {
  enum class What {
    kEnable,
    kDisable,
    kStep,
    kGoTo,
    kSetZero,
    kHome,
    kHomeAll,
    kSetOutput,
    kEndCompare,
    kHold,
    kResume,
    kSpeedOverride,
    kStop,
    kRecover,
  };

  What what = What::kStop;
  std::string axis;         ///< empty: all
  double distance = 0.0;    ///< [m|rad] the length of a step
  double position = 0.0;    ///< [m|rad] to go to
  double factor = 1.0;      ///< a speed override of 1.0 changes nothing
  std::string output = {};  ///< the output to switch
  bool on = false;          ///< whether it is to be on

  /// The call in words: `x: home`. Only one call of a name is in progress at a time.
  std::string name() const;
};

/// What to send to the driver now.
struct Orders {
  bool emergency_stop = false;
  std::vector<Call> calls;
  std::vector<HeldJog::Order> jogs;
};

/// Jog speeds, as fractions of the axis's highest speed.
struct JogSpeeds {
  double slow = 0.05;
  double fast = 0.5;
};

/// The distances of `-` and `+`: one step of the motor, or a distance.
class StepSize {
 public:
  /// Chooses the next larger one; after the largest one comes the smallest.
  void next();
  /// [mm|deg] empty: one step of the motor
  std::optional<double> distance() const;
  /// `0.1 mm`
  std::string text(const std::string& unit) const;

 private:
  int index_ = 0;
};

/// A position prompt that is closed, or wasn't opened, although the user may still be typing into
/// it. What is typed must not be taken for commands.
struct ClosedPrompt {
  std::string axis;
  bool typed = false;  ///< a part of a number was typed: what follows may be its unit
};

/// What the user wants, and the results: the part of the console that is neither ROS nor a
/// terminal. It has no clock: times are seconds on any clock that never goes back.
///
/// Only a key moves an axis, and no key moves an axis that isn't enabled, or whose state isn't
/// live. Stops, holds and the emergency stop are sent in any state.
class Session {
 public:
  enum class Emergency { kNone, kSent, kStopped, kFailed };

  struct PendingCall {
    Call call;
    double since = 0.0;
  };

  /// @param driver full name of the node.
  Session(std::string driver, JogSpeeds speeds) : name_(std::move(driver)), speeds_(speeds) {}

  /// All keys since the last call. An emergency stop among them comes first, and the other keys are
  /// dropped. While a position is being typed, or the question about zero is open, the keys belong
  /// to that, except for those that stop or quit; Escape cancels it. After a prompt that was
  /// refused or that a stop has closed, see closedPrompt(), the keys of a number do nothing until
  /// Enter or Escape, and once one was typed, nor do all others but those that stop or quit.
  Orders press(const std::vector<Key>& keys, double now);
  /// Handles the passing of time. Call it often.
  Orders tick(double now);
  /// Ends the jog, if there is one.
  Orders rest();

  /// @param message in the units of the driver or of the table.
  void answered(const Call& call, bool success, const std::string& message);
  /// A line of the driver's log.
  void logged(const std::string& text);
  void emergencyAnswered(bool success, const std::string& message);
  /// The states of the axes, see DriverView.
  void update(std::vector<AxisView> axes, double now);

  DriverView& driver() { return driver_; }
  const DriverView& driver() const { return driver_; }
  Messages& messages() { return messages_; }
  const Messages& messages() const { return messages_; }
  HeldJog& jog() { return jog_; }

  const std::string& driverName() const { return name_; }
  /// The chosen axis, to which the keys apply; empty if there is none.
  const std::string& chosen() const { return chosen_; }
  /// The output that `t` switches; nullptr if the driver has none.
  const OutputView* chosenOutput() const;
  const StepSize& stepSize() const { return step_size_; }
  /// The position that is being typed; nullptr: none.
  const PositionPrompt* prompt() const { return prompt_ ? &*prompt_ : nullptr; }
  /// nullptr: no typing is left over.
  const ClosedPrompt* closedPrompt() const { return closed_prompt_ ? &*closed_prompt_ : nullptr; }
  /// The axis whose present position becomes 0 if the user says yes; empty: no such question.
  const std::optional<std::string>& zeroAsked() const { return zero_asked_; }
  /// The driver's, whoever set it; empty: unknown, because the driver's state isn't live.
  std::optional<double> speedOverride() const { return override_; }
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
  void home(bool all, double now, Orders& orders);
  void chooseNextOutput();
  void switchOutput(double now, Orders& orders);
  /// No position switches the chosen output any more.
  void endCompare(double now, Orders& orders);
  void openPrompt(double now);
  void typeInto(Key key, double now, Orders& orders);
  /// Obeys a key that stops or quits, and closes what is being typed or asked.
  bool leavesDialogue(Key key, double now, Orders& orders);
  void goToTyped(double now, Orders& orders);
  /// Closes the prompt, and the question about zero, before the user has answered them.
  void closeDialogues();
  /// Whether a key was meant for a prompt that is closed.
  bool isLeftOver(Key key);
  void askForZero(double now);
  void answerZero(Key key, double now, Orders& orders);
  /// Says why not.
  bool mayBeZeroed(const std::string& name, double now);
  void resume(double now, Orders& orders);
  void changeOverride(int direction, double now, Orders& orders);
  /// Why the axis must not be moved; empty: it may be moved.
  std::string hindrance(const std::string& name, double now) const;
  void endJog(Orders& orders);
  void call(Call call, double now, Orders& orders);

  const std::string name_;
  const JogSpeeds speeds_;
  DriverView driver_;
  Messages messages_;
  HeldJog jog_;
  StepSize step_size_;
  std::optional<PositionPrompt> prompt_;
  std::optional<ClosedPrompt> closed_prompt_;
  std::optional<std::string> zero_asked_;
  std::optional<double> override_;
  std::string chosen_;
  std::string chosen_output_;
  std::vector<PendingCall> pending_;
  Emergency emergency_ = Emergency::kNone;
  double emergency_since_ = 0.0;
  std::string emergency_message_;
  bool emergency_seen_ = false;  // in the driver's state
  bool help_ = false;
  bool ended_ = false;
};

}  // namespace stepdriver::console
