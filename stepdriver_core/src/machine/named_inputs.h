#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "activity/context.h"
#include "activity/debounced_input.h"
#include "activity/input_edges.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/machine/io.h"

namespace stepdriver::machine {

/// An input with a name.
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
  pulse::Nanoseconds due() const { return input_.due(); }
  /// Whether its last reading was active.
  bool isActiveNow(const activity::Context& context) const {
    const int level = context.levels.level(input_.line());
    return level >= 0 && (level != 0) == input_.activeLevel();
  }
  /// Why its last reading has failed; empty: it hasn't.
  std::string failureNow(const activity::Context& context) const;
  /// Its edges, for somebody else who watches it.
  activity::InputEdges edges() const {
    return {input_.line(), input_.activeLevel(), input_.debounce()};
  }
  /// Whether its level must be read until it has stayed.
  bool isBouncing() const { return input_.bouncesSince().has_value(); }

 private:
  activity::DebouncedInput input_;
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
  /// Whether the last reading of an input was active, by its number in the configuration.
  bool isActiveNow(const activity::Context& context, std::size_t input) const {
    return inputs_.at(input).isActiveNow(context);
  }
  std::string failureNow(const activity::Context& context, std::size_t input) const {
    return inputs_.at(input).failureNow(context);
  }
  /// The edges of an input, by its number in the configuration.
  activity::InputEdges edgesOf(std::size_t input) const { return inputs_.at(input).edges(); }
  /// Whether one of them waits for its level.
  bool areWatched() const;
  std::vector<InputState> states() const;

 private:
  std::vector<NamedInput> inputs_;
};

}  // namespace stepdriver::machine
