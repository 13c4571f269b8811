#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "profile/composition.h"

namespace stepdriver::motion {

/// The motion of one motor along a curve, and its limits.
struct LimitedCurve {
  std::shared_ptr<const Profile> curve;  ///< q(s), with s in seconds from its start
  MotorBounds bounds;
};

/// Whether all motors keep to their limits while the rate changes in a piece of the path.
bool staysWithin(const std::vector<LimitedCurve>& curves, const Piece& piece);

/// Adds a piece that keeps a rate from a place [s] to the end of the curves; adds nothing at a rate
/// of 0.
void keepToTheEnd(std::vector<Piece>& pieces, DoubleDouble place, double rate, DoubleDouble end);

/// The path s(t) along curves that comes to a lower rate as soon as the limits of their motors
/// allow, and keeps that rate to the end; a rate of 0 comes to rest. At each place the motor with
/// the least room decides how fast the rate falls. With |q'' s'^2 + q' s''| <= a, that is s'' = -(a
/// + q'' s'^2) / q' for q' > 0, and the same with both signs turned for q' < 0. A lower rate needs
/// less of each limit, so it is never wrong later to have fallen as fast as possible. Jerk limits
/// are ignored.
///
/// @param from the current position [s] and rate
/// @param rate from 0 to the current one
/// @param slice [s] a duration. The slope is constant during each slice, and chosen so that all
///   motors keep to their limits in the whole of it, see staysWithin().
/// @param most [s] a path that takes longer than this to reach the lower rate is of no use
/// @param end [s] the end of the curves
/// @return nothing if the rate isn't reached within `most`, or only at the end of the curves.
/// @pre a current rate above 0
std::optional<Profile> planFeedDeceleration(std::int64_t start_ns, const MotionState& from,
                                            double rate, const std::vector<LimitedCurve>& curves,
                                            double slice, double most, DoubleDouble end);

}  // namespace stepdriver::motion
