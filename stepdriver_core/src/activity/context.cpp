#include "context.h"

#include <algorithm>

namespace stepdriver::activity {

std::shared_ptr<std::vector<pulse::Follow>> Context::newCommand(std::uint64_t start) {
  const auto shared = std::find_if(
      follow_commands_.begin(), follow_commands_.end(),
      [start](const FollowCommand& other) { return start != 0 && other.start == start; });
  if (shared != follow_commands_.end()) return shared->follows;
  auto follows = std::make_shared<std::vector<pulse::Follow>>();
  follow_commands_.push_back({out->commands.size(), start, follows});
  out->commands.emplace_back();
  return follows;
}

void Context::endTurn() {
  for (const FollowCommand& command : follow_commands_) {
    pulse::Command& posted = out->commands[command.index];
    posted.follows = command.follows->data();
    posted.follow_count = command.follows->size();
  }
  follow_commands_.clear();
}

}  // namespace stepdriver::activity
