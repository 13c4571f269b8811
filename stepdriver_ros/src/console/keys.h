#pragma once

#include <optional>

namespace stepdriver::console {

/// A key from the terminal: a character's code, or one of these.
using Key = int;
constexpr Key kKeyUp = 0x110001;  // beyond every character
constexpr Key kKeyDown = 0x110002;
constexpr Key kKeyLeft = 0x110003;
constexpr Key kKeyRight = 0x110004;
constexpr Key kKeyShiftLeft = 0x110005;
constexpr Key kKeyShiftRight = 0x110006;
constexpr Key kKeyCtrlC = 3;
constexpr Key kKeyEnter = '\n';
constexpr Key kKeyEscape = 27;
constexpr Key kKeyBackspace = 127;

enum class Action {
  kEmergencyStop,
  kStop,
  kRecover,
  kPreviousAxis,
  kNextAxis,
  kChooseAxis,
  kJog,
  kStep,
  kStepSize,
  kGoTo,
  kSetZero,
  kHold,
  kResume,
  kSlower,
  kFaster,
  kEnable,
  kDisable,
  kEnableAll,
  kDisableAll,
  kHome,
  kHomeAll,
  kNextOutput,
  kSwitchOutput,
  kEndCompare,
  kHelp,
  kQuit,
};

enum class JogSpeed { kSlow, kFast };

/// The command of a key.
struct Command {
  Action action = Action::kHelp;
  int direction = 0;                 ///< a jog or a step goes there: -1 or 1
  JogSpeed speed = JogSpeed::kSlow;  ///< how fast a jog is
  int index = 0;                     ///< index of the axis to choose, from 0
};

/// @return empty if the key has no meaning.
std::optional<Command> commandOf(Key key);

}  // namespace stepdriver::console
