#include "timeline/mark_follower.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::pulse {

void MarkFollower::follow(const Entry& entry) {
  if (follows()) {
    while (size_ > 0 && successors_[size_ - 1].start() >= entry.start()) --size_;
    successors_[size_++] = entry;
  } else {
    current_ = entry;
    piece_ = 0;
    made_ = 0;
    began_ = entry.start();
  }
  find();
}

void MarkFollower::end() {
  current_ = {};
  size_ = 0;
  due_.reset();
}

void MarkFollower::advance() {
  ++made_;
  find();
}

void MarkFollower::takeOver() {
  current_ = successors_[0];
  std::copy(successors_.begin() + 1, successors_.begin() + static_cast<std::ptrdiff_t>(size_),
            successors_.begin());
  --size_;
  piece_ = 0;
}

// A mark is one of the motion that is planned to be at its place first.
void MarkFollower::find() {
  for (;;) {
    due_.reset();
    made_ = std::max(made_, current_.marks->first);
    if (made_ < current_.marks->end()) {
      const motion::Mark& mark = nextMark();
      const auto there = motion::timeAtPlace(*current_.along, mark.place_ns, piece_);
      if (there && (size_ == 0 || *there < successors_[0].start())) {
        due_ = std::max(began_, madeAt(*there) - current_.marks->lead(mark));
        return;
      }
    }
    if (size_ == 0) return;
    takeOver();
  }
}

// The motions that are made at a time: what takes over changes where the axes are even if their
// plan has already been at the place.
const motion::ShapedAxes& MarkFollower::axesAt(Nanoseconds time) const {
  const motion::ShapedAxes* axes = current_.axes;
  for (std::size_t i = 0; i < size_ && successors_[i].start() <= time; ++i) {
    axes = successors_[i].axes;
  }
  return *axes;
}

// When the axes are at a place, if an input shaper makes them later. As seen along the path there,
// no part of the motion is beyond the place when the plan is there, and all are when the longest
// delay is over. If the path turns so soon that this isn't so, one of these times is taken.
Nanoseconds MarkFollower::madeAt(Nanoseconds planned) const {
  if (current_.axes == nullptr) return planned;
  const motion::ShapedAxes::Place place(*current_.axes, planned);
  const auto way_at = [&](Nanoseconds time) { return place.wayAt(axesAt(time), time); };
  Nanoseconds low = planned;
  Nanoseconds high = planned + current_.axes->longestDelayNs();
  if (!(way_at(low).beyond < 0.0)) return low;
  Nanoseconds time = low + (high - low) / 2;
  // Newton's steps, or halvings if one of them leaves the bracket.
  while (high - low > 1) {
    const auto [beyond, speed] = way_at(time);
    (beyond < 0.0 ? low : high) = time;
    const double step_ns = speed > 0.0 ? 1e9 * beyond / speed : HUGE_VAL;
    if (std::abs(step_ns) < 0.5) return time;
    const auto width = static_cast<double>(high - low);
    const Nanoseconds better = std::abs(step_ns) < width ? time - std::llrint(step_ns) : low;
    time = better > low && better < high ? better : low + (high - low) / 2;
  }
  return high;
}

}  // namespace stepdriver::pulse
