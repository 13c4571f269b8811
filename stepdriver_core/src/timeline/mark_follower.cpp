#include "timeline/mark_follower.h"

#include <algorithm>

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

// A mark is one of the motion that is at its place first: what takes over later doesn't change it,
// even if it comes later than its place.
void MarkFollower::find() {
  for (;;) {
    due_.reset();
    made_ = std::max(made_, current_.marks->first);
    if (made_ < current_.marks->end()) {
      const motion::Mark& mark = nextMark();
      const auto there = motion::timeAtPlace(*current_.along, mark.place_ns, piece_);
      if (there && (size_ == 0 || *there < successors_[0].start())) {
        due_ = std::max(began_, *there + current_.delay - current_.marks->lead(mark));
        return;
      }
    }
    if (size_ == 0) return;
    takeOver();
  }
}

}  // namespace stepdriver::pulse
