#include "move_log.h"

#include <utility>

namespace stepdriver::axis {
namespace {

// Whoever waits for a move asks every millisecond; this many don't end in that time.
constexpr std::size_t kRemembered = 256;

}  // namespace

void MoveLog::withdraw(std::uint64_t serial) {
  if (!motions_.empty() && motions_.back().serial == serial) motions_.pop_back();
}

void MoveLog::dropBefore(std::uint64_t serial) {
  while (!motions_.empty() && motions_.front().serial < serial) motions_.pop_front();
}

const Motion* MoveLog::find(std::uint64_t serial) const {
  for (const Motion& motion : motions_) {
    if (motion.serial == serial) return &motion;
  }
  return nullptr;
}

void MoveLog::conclude(std::uint64_t move, MoveResult result) {
  concluded_.push_back({move, std::move(result)});
  if (concluded_.size() > kRemembered) concluded_.pop_front();
}

std::optional<MoveResult> MoveLog::result(std::uint64_t move) const {
  for (const Concluded& concluded : concluded_) {
    if (concluded.move == move) return concluded.result;
  }
  return std::nullopt;
}

}  // namespace stepdriver::axis
