#include "motions.h"

#include <algorithm>

namespace stepdriver::motor {

void Motions::update(const pulse::ChannelState& state) {
  following_ = state.following;
  taken_ = state.taken;
  const auto refused = [&state](const Motion& motion) {
    return motion.serial > state.accepted && motion.serial <= state.taken;
  };
  const auto first = std::find_if(motions_.begin(), motions_.end(), refused);
  const auto last = std::find_if_not(first, motions_.end(), refused);
  motions_.erase(first, last);
  const std::uint64_t needed = state.following != 0 ? state.following : state.ended;
  while (!motions_.empty() && motions_.front().serial < needed) motions_.pop_front();
}

const Motion* Motions::find(std::uint64_t serial) const {
  const auto found = std::find_if(motions_.begin(), motions_.end(), [serial](const Motion& motion) {
    return motion.serial == serial;
  });
  return found != motions_.end() ? &*found : nullptr;
}

}  // namespace stepdriver::motor
