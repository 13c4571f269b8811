#include "named_inputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "gpio/chip_table.h"

namespace stepdriver::machine {
namespace {

// How often a level is read that must stay, if no edge is reported.
constexpr pulse::Nanoseconds kReadPeriod = 1'000'000;

}  // namespace

// ---- one ----

NamedInput::NamedInput(const config::InputConfig& config, int line) : config_(config), line_(line) {
  state_.name = config.name;
}

void NamedInput::begin(const activity::Context& context) {
  level_ = context.levels.level(line_);
  level_since_ = context.now;
  state_.active = *level_ >= 0 && (*level_ != 0) == config_.line.active_level;
}

void NamedInput::poll(const activity::Context& context) {
  if (!level_) return;
  polled_at_ = context.now;
  const int level = context.levels.level(line_);
  state_.error =
      level < 0 ? fmt::format("the line {} of the input {} can't be read: {}",
                              context.lines.input(line_), config_.name, gpio::errorText(-level))
                : "";
  const bool has_changed = level != std::exchange(level_, level);
  if (has_changed || left_) noteChange(context, has_changed);
  if (has_changed) level_since_ = context.now;
  if (!left_ || context.now < quiet_since_ + config_.debounce_ns) return;
  const pulse::Nanoseconds left = *std::exchange(left_, std::nullopt);
  const bool active = (level != 0) == config_.line.active_level;
  if (level < 0 || active == state_.active) return;
  state_.active = active;
  state_.changed = left;
}

// Edges are reported before the level that was read after them. Those of one change are no further
// apart than the time for which a level must stay.
void NamedInput::noteChange(const activity::Context& context, bool has_changed) {
  const std::vector<gpio::EdgeEvent> edges =
      context.levels.since(line_, left_ ? quiet_since_ : level_since_);
  const bool tells = !edges.empty() && (!has_changed || edges.back().level == (*level_ > 0));
  const auto time_of = [&](std::size_t edge) { return std::min(edges[edge].time_ns, context.now); };
  if (tells) {
    quiet_since_ = time_of(edges.size() - 1);
  } else if (has_changed) {
    quiet_since_ = context.now;
  }
  if (left_) return;
  left_ = quiet_since_;
  for (std::size_t i = edges.size(); tells && i-- > 0;) {
    if (*left_ - time_of(i) > config_.debounce_ns) break;
    left_ = time_of(i);
  }
}

pulse::Nanoseconds NamedInput::due() const {
  if (!left_) return pulse::kNever;
  return std::min(quiet_since_ + config_.debounce_ns, polled_at_ + kReadPeriod);
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
