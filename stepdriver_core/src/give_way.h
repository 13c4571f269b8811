#pragma once

#include <cstddef>
#include <thread>

namespace stepdriver {

/// Lets other threads run in the middle of a long loop. Call it with the index of each item.
///
/// If all processors are busy, a thread that wakes up may have to wait for the next tick of the
/// scheduler, 4 ms at 250 Hz. A stop that comes while long trajectories are prepared must not.
inline void giveWay(std::size_t index) {
  constexpr std::size_t kEvery = 64;  // items: about 0.1 ms of planning
  if (index % kEvery == kEvery - 1) std::this_thread::yield();
}

/// The same for items that take a fraction of that: the places of a path, the points of a
/// trajectory.
inline void giveWayAt(std::size_t place) {
  constexpr std::size_t kPlaces = 8;  // as long as an item
  if (place % kPlaces == 0) giveWay(place / kPlaces);
}

}  // namespace stepdriver
