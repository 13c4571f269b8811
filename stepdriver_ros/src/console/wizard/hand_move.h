#pragma once

#include "dialogue.h"
#include "machine_at_hand.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// A small and slow move, for a machine about which nothing is known yet.
struct SmallMove {
  double distance = 0.0;  ///< [mm|deg]
  double speed = 0.0;     ///< [mm/s|deg/s]
};

/// To see the direction.
SmallMove visibleMove(const config::AxisConfig& config);
/// To measure it.
SmallMove measurableMove(const config::AxisConfig& config);

/// Moves an axis after a question, and watches it. A line from the user stops it, and so does any
/// change of a switch, because it isn't known yet which switch is at which end.
class HandMove {
 public:
  /// All outlive this object.
  HandMove(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config)
      : dialogue_(dialogue), machine_(machine), config_(config) {}

  /// @param move its distance is negative towards minus.
  /// @return [mm|deg] the counted distance; 0: it didn't move, or the move wasn't completed.
  double ask(const SmallMove& move);

 private:
  double watch(double start);
  void rest();
  /// The next state of the driver, not one that was already on its way.
  AxisView freshState();

  Dialogue& dialogue_;
  MachineAtHand& machine_;
  const config::AxisConfig& config_;
};

}  // namespace stepdriver::console
