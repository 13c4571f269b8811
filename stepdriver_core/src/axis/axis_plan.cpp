#include <stdexcept>

#include "axis_impl.h"

namespace stepdriver::axis {

MovePlan Axis::plan(double position, bool relative, double velocity) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->planOf(impl_->checkedGoal(position, relative, velocity));
}

MovePlan Axis::Impl::planOf(const Goal& goal) {
  motion::Plan planned = [&] {
    try {
      return plan(goal, earliest(driver.motionNow(), 0));
    } catch (const std::range_error& error) {
      refuse(error.what());
    }
  }();
  const motion::Profile& profile = planned.profile;
  MovePlan shown;
  shown.steps_per_unit = stepsPerUnit();
  shown.move = moveOf(profile, planned.overshoot);
  const double unit = 1.0 / stepsPerUnit();
  for (const motion::Piece& piece : profile.pieces()) {
    shown.pieces.push_back({piece.duration.value(), positionOf(piece.p0.value()), piece.v0 * unit,
                            piece.a * unit, piece.j * unit});
  }
  return shown;
}

Move Axis::Impl::moveOf(const motion::Profile& profile, double overshoot) {
  return {0, positionOf(jointAt(profile.endPosition().value())),
          static_cast<double>(profile.endNs() - profile.startNs()) * 1e-9,
          overshoot / stepsPerUnit()};
}

}  // namespace stepdriver::axis
