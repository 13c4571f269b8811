#include "input_levels.h"

#include <algorithm>
#include <iterator>

namespace stepdriver::axis {

bool InputLevels::update(int input, int level) {
  int& known = levels_.at(static_cast<std::size_t>(input));
  if (known == level) return false;
  known = level;
  return true;
}

void InputLevels::add(const gpio::EdgeEvent& edge) {
  edges_.push_back(edge);
  if (edges_.size() > kRemembered) edges_.pop_front();
}

std::vector<gpio::EdgeEvent> InputLevels::since(int input, std::int64_t time_ns) const {
  std::vector<gpio::EdgeEvent> found;
  std::copy_if(
      edges_.begin(), edges_.end(), std::back_inserter(found),
      [&](const gpio::EdgeEvent& edge) { return edge.input == input && edge.time_ns > time_ns; });
  return found;
}

}  // namespace stepdriver::axis
