#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "storm/oracle.h"
#include "storm/rig_clock.h"

namespace stepdriver::storm {

/// Where the joints were: by the positions that the node told at rest, the pulses that the rig saw
/// from there on, and the play of the backlash.
class Joints {
 public:
  /// @param seen, clock outlive it.
  Joints(const Observation& seen, const RigClock& clock);

  /// Whether the origin of the position may have changed between two times of CLOCK_MONOTONIC.
  bool mayBeRenamed(std::size_t axis, std::int64_t begin, std::int64_t end) const;
  /// The count of the pulses when the rig's clock shows this.
  std::int64_t countShown(std::size_t axis, std::int64_t rig) const;
  /// [m] Of the joint when the rig's clock shows this. Empty: it isn't known, because the axes
  /// have not rested before, the origin may have changed since, or the play isn't known.
  std::optional<double> positionShown(std::size_t axis, std::int64_t rig) const;

 private:
  /// What is taken up of a backlash: between two numbers of steps, which a long way makes equal.
  struct Play {
    double low = 0.0;
    double high = 0.0;
  };

  std::size_t pulsesUntil(std::size_t axis, std::int64_t rig) const;
  std::optional<double> playAfter(std::size_t axis, std::size_t pulses) const;

  const Observation& seen_;
  const RigClock& clock_;
  std::vector<std::vector<const Request*>> renamings_;  // for each axis
  std::vector<std::vector<Play>> plays_;  // for each axis before the first pulse and after each
};

}  // namespace stepdriver::storm
