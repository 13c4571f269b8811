#include "named_inputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "gpio/chip_table.h"

namespace stepdriver::machine {
// ---- one ----

NamedInput::NamedInput(const config::InputConfig& config, int line)
    : input_(line, config.line.active_level, config.debounce_ns) {
  state_.name = config.name;
}

void NamedInput::begin(const activity::Context& context) {
  input_.begin(context);
  state_.active = input_.active();
}

void NamedInput::poll(const activity::Context& context) {
  input_.poll(context);
  state_.active = input_.active();
  state_.changed = input_.changed();
  state_.error = failureNow(context);
}

std::string NamedInput::failureNow(const activity::Context& context) const {
  const int level = context.levels.level(input_.line());
  if (level >= 0) return "";
  return fmt::format("the line {} of the input {} can't be read: {}",
                     context.lines.input(input_.line()), state_.name, gpio::errorText(-level));
}

// ---- all ----

NamedInputs::NamedInputs(const std::vector<config::InputConfig>& inputs,
                         const std::vector<int>& lines) {
  for (std::size_t i = 0; i < inputs.size(); ++i) inputs_.emplace_back(inputs[i], lines[i]);
}

void NamedInputs::begin(const activity::Context& context) {
  for (NamedInput& input : inputs_) input.begin(context);
}

void NamedInputs::poll(const activity::Context& context) {
  for (NamedInput& input : inputs_) input.poll(context);
}

pulse::Nanoseconds NamedInputs::due() const {
  pulse::Nanoseconds due = pulse::kNever;
  for (const NamedInput& input : inputs_) due = std::min(due, input.due());
  return due;
}

bool NamedInputs::areWatched() const {
  return std::any_of(inputs_.begin(), inputs_.end(),
                     [](const NamedInput& input) { return input.isBouncing(); });
}

std::vector<InputState> NamedInputs::states() const {
  std::vector<InputState> states;
  for (const NamedInput& input : inputs_) states.push_back(input.state());
  return states;
}

}  // namespace stepdriver::machine
