#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "activity/context.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/machine/io_states.h"

namespace stepdriver::machine {

/// An input with a name: its level after bouncing. Edges say when something has changed, and only
/// the level that was read says to what: a lost edge costs no more than the exact time.
class NamedInput {
 public:
  /// @param line its index in the request.
  NamedInput(const config::InputConfig& config, int line);

  const InputState& state() const { return state_; }

  /// The levels are known from now on.
  void begin(const activity::Context& context);
  /// Something may have happened.
  void poll(const activity::Context& context);
  /// Clock time by which poll() must be called.
  pulse::Nanoseconds due() const;
  /// Whether its level must be read until it has stayed.
  bool isBouncing() const { return left_.has_value(); }

 private:
  void noteChange(const activity::Context& context, bool has_changed);

  config::InputConfig config_;
  int line_;
  std::optional<int> level_;                // as read last; empty: before begin()
  pulse::Nanoseconds level_since_ = 0;      // when that was read first
  std::optional<pulse::Nanoseconds> left_;  // when its level began to change
  pulse::Nanoseconds quiet_since_ = 0;      // the latest change of its level after that
  pulse::Nanoseconds polled_at_ = 0;
  InputState state_;
};

/// All inputs with a name of a machine.
class NamedInputs {
 public:
  NamedInputs() = default;
  /// @param lines of each, by its index in the request.
  NamedInputs(const std::vector<config::InputConfig>& inputs, const std::vector<int>& lines);

  void begin(const activity::Context& context);
  void poll(const activity::Context& context);
  pulse::Nanoseconds due() const;
  /// Whether one of them waits for its level.
  bool areWatched() const;
  std::vector<InputState> states() const;

 private:
  std::vector<NamedInput> inputs_;
};

}  // namespace stepdriver::machine
