#include "compare_plan.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "profile/resting_count.h"

namespace stepdriver::activity {
namespace {

using config::PositionCompare;
using pulse::CompareAction;
using pulse::CompareEdge;
using Direction = PositionCompare::Direction;

// Places that are one microstep in a coarser mode share their edges.
void mergeEqual(std::vector<CompareEdge>& edges) {
  std::stable_sort(
      edges.begin(), edges.end(),
      [](const CompareEdge& one, const CompareEdge& other) { return one.at < other.at; });
  std::vector<CompareEdge> merged;
  for (const CompareEdge& edge : edges) {
    if (merged.empty() || merged.back().at != edge.at) {
      merged.push_back(edge);
      continue;
    }
    if (edge.up != CompareAction::kNothing) merged.back().up = edge.up;
    if (edge.down != CompareAction::kNothing) merged.back().down = edge.down;
  }
  edges = std::move(merged);
}

}  // namespace

pulse::CompareTrack trackOf(const PositionCompare& compare, const axis::AxisModel& axis) {
  pulse::CompareTrack track;
  track.pulse = compare.pulse_ns;
  track.pulse_at_end = compare.at_end;
  track.lead_on = compare.lead_on_ns;
  track.lead_off = compare.lead_off_ns;
  track.backlash = axis.backlash();
  const bool up = compare.direction != Direction::kDown;
  const bool down = compare.direction != Direction::kUp;
  const auto action = [](bool comes, CompareAction what) {
    return comes ? what : CompareAction::kNothing;
  };
  const auto count = [&axis](double place) { return motion::restingCount(axis.countOf(place)); };
  for (const PositionCompare::Cam& cam : compare.cams) {
    track.edges.push_back({count(cam.from), action(up, CompareAction::kOn), CompareAction::kOff});
    track.edges.push_back(
        {count(cam.to) + 1, CompareAction::kOff, action(down, CompareAction::kOn)});
  }
  track.by_place = up && down;
  const auto add = [&](double place) {
    const std::int64_t at = count(place);
    if (up) track.edges.push_back({at, CompareAction::kPulse, CompareAction::kNothing});
    if (down) track.edges.push_back({at + 1, CompareAction::kNothing, CompareAction::kPulse});
  };
  for (const double place : compare.places) add(place);
  if (const auto& every = compare.every) {
    // The last place counts also if the quotient is a rounding below a whole number.
    const double count_of = (every->to - every->from) / every->distance;
    const auto last = static_cast<std::int64_t>(std::floor(count_of + 1e-9));
    for (std::int64_t i = 0; i <= last; ++i) {
      add(std::min(every->from + static_cast<double>(i) * every->distance, every->to));
    }
  }
  mergeEqual(track.edges);
  return track;
}

}  // namespace stepdriver::activity
