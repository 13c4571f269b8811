#include "context.h"

#include <algorithm>

namespace stepdriver::activity {

std::shared_ptr<std::vector<pulse::Follow>> Context::newCommand(std::uint64_t start) {
  const auto shared = std::find_if(
      follow_commands_.begin(), follow_commands_.end(),
      [start](const FollowCommand& other) { return start != 0 && other.start == start; });
  if (shared != follow_commands_.end()) return shared->follows;
  auto follows = std::make_shared<std::vector<pulse::Follow>>();
  follow_commands_.push_back({out->commands.size(), start, follows, nullptr});
  out->commands.emplace_back();
  return follows;
}

std::shared_ptr<std::vector<pulse::FollowMarks>> Context::marksOf(
    const std::shared_ptr<std::vector<pulse::Follow>>& command) {
  const auto found =
      std::find_if(follow_commands_.begin(), follow_commands_.end(),
                   [&](const FollowCommand& other) { return other.follows == command; });
  if (!found->marks) found->marks = std::make_shared<std::vector<pulse::FollowMarks>>();
  return found->marks;
}

std::vector<int> Context::addressesOn(const std::string& port) const {
  std::vector<int> addresses;
  for (const auto& axis : axes) {
    for (std::size_t i = 0; i < axis->motor.chips(); ++i) {
      const motor::TmcChip* chip = axis->motor.tmcAt(i);
      if (chip != nullptr && chip->config().port == port) {
        addresses.push_back(chip->config().address);
      }
    }
  }
  return addresses;
}

void Context::beginTurn(Outputs& outputs) {
  // Edges are reported within a few turns.
  constexpr std::size_t kMostSlips = 64;
  out = &outputs;
  if (slips_.empty() || slips_.back().slipped != slipped) slips_.push_back({last_turn_, slipped});
  if (slips_.size() > kMostSlips) slips_.pop_front();
  last_turn_ = now;
}

pulse::Nanoseconds Context::motionTimeAt(pulse::Nanoseconds clock_time) const {
  const auto slip = std::find_if(slips_.rbegin(), slips_.rend(),
                                 [&](const Slip& one) { return one.from <= clock_time; });
  return clock_time - (slip != slips_.rend() ? slip->slipped : slips_.front().slipped);
}

void Context::endTurn() {
  for (const FollowCommand& command : follow_commands_) {
    pulse::Command& posted = out->commands[command.index];
    posted.follows = command.follows->data();
    posted.follow_count = command.follows->size();
    if (!command.marks) continue;
    posted.marks = command.marks->data();
    posted.marks_count = command.marks->size();
  }
  follow_commands_.clear();
}

}  // namespace stepdriver::activity
