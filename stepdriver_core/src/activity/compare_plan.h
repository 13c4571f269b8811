#pragma once

#include "axis/axis_model.h"
#include "stepdriver_core/config/io_config.h"
#include "timeline/compare_track.h"

namespace stepdriver::activity {

/// The track of an output that the position of an axis switches, in counts of its present microstep
/// mode: an action comes when the joint arrives at the whole microstep nearest to its place.
/// @pre config::whyNotCompared() is empty.
pulse::CompareTrack trackOf(const config::PositionCompare& compare, const axis::AxisModel& axis);

}  // namespace stepdriver::activity
