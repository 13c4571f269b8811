#pragma once

#include <string>
#include <vector>

#include "storm/joints.h"
#include "storm/oracle.h"
#include "storm/rig_clock.h"

namespace stepdriver::storm {

/// Compares the places at which outputs were switched and inputs changed with what was asked and
/// told:
///
/// - A pulse of an output that a position switches begins with a step of the axis to one of its
///   places, in its direction, and is no longer than it was asked for. In a motion alone each
///   passage of a place makes one.
/// - A path alone switches its output at each of its marks, in their order and at their places.
/// - A latch, and a contact that a probing tells, is at an edge of the input, where the axes were
///   then. A latch with a window tells only of edges in it.
///
/// @return each broken promise in words.
std::vector<std::string> brokenPlaces(const Observation& seen, const RigClock& clock,
                                      const Joints& joints);

}  // namespace stepdriver::storm
