#include "debounced_input.h"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace stepdriver::activity {
namespace {

// How often a level is read that must stay, if no edge is reported.
constexpr pulse::Nanoseconds kReadPeriod = 1'000'000;

}  // namespace

void DebouncedInput::begin(const Context& context) {
  level_ = context.levels.level(line_);
  level_since_ = context.now;
  active_ = *level_ >= 0 && (*level_ != 0) == active_level_;
}

bool DebouncedInput::poll(const Context& context) {
  if (!level_) return false;
  polled_at_ = context.now;
  const int level = context.levels.level(line_);
  const bool has_changed = level != std::exchange(level_, level);
  if (has_changed || left_) noteChange(context, has_changed);
  if (has_changed) level_since_ = context.now;
  if (!left_ || context.now < quiet_since_ + debounce_) return false;
  const pulse::Nanoseconds left = *std::exchange(left_, std::nullopt);
  const bool active = (level != 0) == active_level_;
  if (level < 0 || active == active_) return false;
  active_ = active;
  changed_ = left;
  change_was_read_ = left_was_read_;
  return true;
}

// Edges are reported before the level that was read after them, unless another thread has read it.
// Those of one change are no further apart than the time for which a level must stay.
void DebouncedInput::noteChange(const Context& context, bool has_changed) {
  const bool is_new = !left_;
  if (is_new) stable_since_ = level_since_;
  const bool begins = is_new || left_was_read_;
  const std::vector<gpio::EdgeEvent> edges =
      context.levels.since(line_, begins ? stable_since_ : quiet_since_);
  const bool tells = !edges.empty() && (!has_changed || edges.back().level == (*level_ > 0));
  const auto time_of = [&](std::size_t edge) { return std::min(edges[edge].time_ns, context.now); };
  if (tells) {
    quiet_since_ = time_of(edges.size() - 1);
  } else if (has_changed) {
    quiet_since_ = context.now;
  }
  if (!is_new && !(begins && tells)) return;
  left_ = quiet_since_;
  left_was_read_ = !tells;
  for (std::size_t i = edges.size(); tells && i-- > 0;) {
    if (*left_ - time_of(i) > debounce_) break;
    left_ = time_of(i);
  }
}

pulse::Nanoseconds DebouncedInput::due() const {
  if (!left_) return pulse::kNever;
  return std::min(quiet_since_ + debounce_, polled_at_ + kReadPeriod);
}

}  // namespace stepdriver::activity
