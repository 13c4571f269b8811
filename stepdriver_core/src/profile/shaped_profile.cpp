#include "shaped_profile.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "negligible_time.h"
#include "profile_parts.h"

namespace stepdriver::motion {

std::int64_t ShapedProfile::endNs() const {
  if (shaper_ == nullptr || profile_->pieceCount() == 0) return profile_->endNs();
  return std::max(start_ns_, profile_->endNs() + shaper_->durationNs());
}

MotionState ShapedProfile::stateAt(std::int64_t time_ns) const {
  if (shaper_ == nullptr) return profile_->stateAt(time_ns);
  MotionState sum;
  for (const Impulse& impulse : shaper_->impulses()) {
    const MotionState state = profile_->stateAt(time_ns - impulse.delay_ns);
    sum.position = sum.position + state.position * impulse.part;
    sum.velocity += state.velocity * impulse.part;
    sum.acceleration += state.acceleration * impulse.part;
  }
  return sum;
}

PlannedMotion PlannedMotion::takenOverBy(std::shared_ptr<const Profile> plan) const {
  PlannedMotion next(std::move(plan), shaper_);
  if (shaper_ == nullptr) return next;
  const std::int64_t at = next.plan_->startNs();
  const std::int64_t start = std::max(profile_->startNs(), at - shaper_->durationNs());
  if (start >= at) return next;
  const DoubleDouble from = secondsOf(start - profile_->startNs());
  const DoubleDouble until = secondsOf(at - profile_->startNs());
  const bool moves = next.plan_->pieceCount() > 0;
  // If the new plan rests, only the end of the motion before it is still to be made.
  const DoubleDouble to = moves ? until : std::min(until, profile_->duration());
  Sections sections;
  if ((to - from).hi > kNegligibleTime) {
    const Profile past = part(*profile_, from, to);
    std::vector<Piece> pieces;
    for (const Piece& piece : past.pieces()) pieces.push_back(piece);
    sections.add(pieces);
  }
  if (moves) sections.add(Excerpt{next.plan_, 0.0, next.plan_->duration()});
  if (!sections.empty()) {
    next.profile_ = std::make_shared<const Profile>(start, std::move(sections));
  }
  return next;
}

}  // namespace stepdriver::motion
