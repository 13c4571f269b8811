#include "input_edges.h"

#include <algorithm>

namespace stepdriver::activity {

void InputEdges::begin(const Context& context) {
  input_.begin(context);
  level_ = context.levels.level(line()) > 0;
  since_ = context.now;
}

std::vector<InputEdges::Edge> InputEdges::poll(const Context& context) {
  std::vector<Edge> edges;
  const bool has_changed = input_.poll(context);
  if (input_.debounce() > 0) {
    if (has_changed) {
      edges.push_back({input_.active(), *input_.changed(), input_.changeWasRead()});
    }
    return edges;
  }
  for (const gpio::EdgeEvent& edge : context.levels.since(line(), since_)) {
    add(edge.level, std::min(edge.time_ns, context.now), false, edges);
  }
  const int level = context.levels.level(line());
  if (level < 0 || (level > 0) == level_) {
    differs_.reset();
  } else if (!differs_) {
    differs_ = context.now;
  } else if (context.levels.edgesAddedUntil() >= edgesDue()) {
    add(level > 0, *differs_, true, edges);
  }
  return edges;
}

// Of two edges in the same direction one was lost.
void InputEdges::add(bool level, pulse::Nanoseconds time, bool was_read, std::vector<Edge>& edges) {
  since_ = std::max(since_, time);
  differs_.reset();
  if (level == level_) return;
  level_ = level;
  edges.push_back({level == active_level_, time, was_read});
}

}  // namespace stepdriver::activity
