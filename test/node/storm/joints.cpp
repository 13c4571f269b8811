#include "storm/joints.h"

#include <algorithm>

namespace stepdriver::storm {

Joints::Joints(const Observation& seen, const RigClock& clock)
    : seen_(seen), clock_(clock), renamings_(seen.axes.size()), plays_(seen.axes.size()) {
  for (std::size_t axis = 0; axis < seen.axes.size(); ++axis) {
    for (const Request& request : seen.requests) {
      if ((request.axes >> axis & 1U) == 0) continue;
      if (request.kind != Kind::kSetPosition && request.kind != Kind::kHoming) continue;
      renamings_[axis].push_back(&request);
    }
    const double whole = seen.axes[axis].backlash * seen.axes[axis].steps_per_metre;
    Play play{0.0, whole};
    std::int64_t count = 0;
    plays_[axis].push_back(play);
    for (const Pulse& pulse : seen.pulses[axis]) {
      const auto way = static_cast<double>(pulse.count - count);
      count = pulse.count;
      play.low = std::clamp(play.low + way, 0.0, whole);
      play.high = std::clamp(play.high + way, 0.0, whole);
      plays_[axis].push_back(play);
    }
  }
}

bool Joints::mayBeRenamed(std::size_t axis, std::int64_t begin, std::int64_t end) const {
  return std::any_of(renamings_[axis].begin(), renamings_[axis].end(), [&](const Request* request) {
    return request->sent < end && (!request->answered || *request->answered > begin);
  });
}

std::size_t Joints::pulsesUntil(std::size_t axis, std::int64_t rig) const {
  const auto& pulses = seen_.pulses[axis];
  const auto after =
      std::upper_bound(pulses.begin(), pulses.end(), rig,
                       [](std::int64_t t, const Pulse& pulse) { return t < pulse.time; });
  return static_cast<std::size_t>(after - pulses.begin());
}

std::int64_t Joints::countShown(std::size_t axis, std::int64_t rig) const {
  const std::size_t pulses = pulsesUntil(axis, rig);
  return pulses == 0 ? 0 : seen_.pulses[axis][pulses - 1].count;
}

std::optional<double> Joints::playAfter(std::size_t axis, std::size_t pulses) const {
  const Play& play = plays_[axis].at(pulses);
  if (play.low < play.high) return std::nullopt;
  return play.low;
}

std::optional<double> Joints::positionShown(std::size_t axis, std::int64_t rig) const {
  const auto after = std::partition_point(
      seen_.rests.begin(), seen_.rests.end(),
      [&](const RestPoint& rest) { return clock_.latestAt(rest.time) <= rig; });
  if (after == seen_.rests.begin()) return std::nullopt;
  const RestPoint& rest = *(after - 1);
  if (mayBeRenamed(axis, rest.time, clock_.whenItShows(rig))) return std::nullopt;
  const std::int64_t rested = clock_.latestAt(rest.time);
  const auto play = playAfter(axis, pulsesUntil(axis, rig));
  const auto play_at_rest = playAfter(axis, pulsesUntil(axis, rested));
  if (!play || !play_at_rest) return std::nullopt;
  const auto way = static_cast<double>(countShown(axis, rig) - countShown(axis, rested));
  return rest.positions[axis] + (way - (*play - *play_at_rest)) / seen_.axes[axis].steps_per_metre;
}

}  // namespace stepdriver::storm
