#include "keys.h"

#include <map>

namespace stepdriver::console {
namespace {

Command jog(int direction, JogSpeed speed) { return {Action::kJog, direction, speed, 0}; }

Command step(int direction) { return {Action::kStep, direction, JogSpeed::kSlow, 0}; }

const std::map<Key, Command>& commands() {
  static const std::map<Key, Command> all = {
      {' ', {Action::kEmergencyStop}},
      {'s', {Action::kStop}},
      {kKeyEscape, {Action::kStop}},
      {'r', {Action::kRecover}},
      {kKeyUp, {Action::kPreviousAxis}},
      {'k', {Action::kPreviousAxis}},
      {kKeyDown, {Action::kNextAxis}},
      {'j', {Action::kNextAxis}},
      {'\t', {Action::kNextAxis}},
      {kKeyLeft, jog(-1, JogSpeed::kSlow)},
      {',', jog(-1, JogSpeed::kSlow)},
      {kKeyRight, jog(1, JogSpeed::kSlow)},
      {'.', jog(1, JogSpeed::kSlow)},
      {kKeyShiftLeft, jog(-1, JogSpeed::kFast)},
      {'<', jog(-1, JogSpeed::kFast)},
      {kKeyShiftRight, jog(1, JogSpeed::kFast)},
      {'>', jog(1, JogSpeed::kFast)},
      {'-', step(-1)},
      {'+', step(1)},
      {'=', step(1)},
      {'i', {Action::kStepSize}},
      {'g', {Action::kGoTo}},
      {'z', {Action::kSetZero}},
      {'p', {Action::kHold}},
      {'c', {Action::kResume}},
      {'[', {Action::kSlower}},
      {']', {Action::kFaster}},
      {'e', {Action::kEnable}},
      {'d', {Action::kDisable}},
      {'m', {Action::kEnableAll}},
      {'o', {Action::kDisableAll}},
      {'h', {Action::kHome}},
      {'a', {Action::kHomeAll}},
      {'n', {Action::kNextOutput}},
      {'t', {Action::kSwitchOutput}},
      {'u', {Action::kEndCompare}},
      {'?', {Action::kHelp}},
      {'q', {Action::kQuit}},
      {kKeyCtrlC, {Action::kQuit}},
  };
  return all;
}

}  // namespace

std::optional<Command> commandOf(Key key) {
  if (key >= '1' && key <= '9') return Command{Action::kChooseAxis, 0, JogSpeed::kSlow, key - '1'};
  const auto found = commands().find(key);
  if (found == commands().end()) return {};
  return found->second;
}

}  // namespace stepdriver::console
