#include "shaped_axes.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace stepdriver::motion {
namespace {

// Of the longest delay: from so long before a place to there, the path has the direction of there.
constexpr std::int64_t kOfDelay = 16;

}  // namespace

ShapedAxes::ShapedAxes(std::vector<ShapedAxis> axes, std::int64_t start_ns)
    : axes_(std::move(axes)), start_ns_(start_ns) {
  for (const ShapedAxis& axis : axes_) {
    const InputShaper* const shaper = axis.motion.made().shaper();
    if (shaper != nullptr) longest_ns_ = std::max(longest_ns_, shaper->durationNs());
  }
}

// At the begin of the motions, the direction is that of what follows.
ShapedAxes::Place::Place(const ShapedAxes& axes, std::int64_t planned_ns)
    : axes_(axes),
      planned_ns_(planned_ns),
      from_ns_(std::max(axes.start_ns_, planned_ns - axes.longest_ns_ / kOfDelay)),
      to_ns_(planned_ns > axes.start_ns_ ? planned_ns : planned_ns + axes.longest_ns_ / kOfDelay) {}

ShapedAxes::Place::Way ShapedAxes::Place::wayAt(const ShapedAxes& made,
                                                std::int64_t time_ns) const {
  Way way;
  for (std::size_t k = 0; k < axes_.axes_.size(); ++k) {
    const ShapedAxis& axis = axes_.axes_[k];
    const Profile& plan = *axis.motion.plan();
    const DoubleDouble from = plan.stateAt(from_ns_).position;
    const double direction = (plan.stateAt(to_ns_).position - from).value() * axis.unit;
    const MotionState is = made.axes_[k].motion.made().stateAt(time_ns);
    const DoubleDouble off = is.position - plan.stateAt(planned_ns_).position;
    way.beyond += direction * off.value() * axis.unit;
    way.speed += direction * is.velocity * axis.unit;
  }
  return way;
}

}  // namespace stepdriver::motion
