#pragma once

#include <string>

#include "dialogue.h"
#include "machine_at_hand.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// A small and slow move, for a machine about which nothing is known yet.
struct SmallMove {
  double distance = 0.0;  ///< [mm|deg]
  double speed = 0.0;     ///< [mm/s|deg/s]
};

/// The move that shows the direction.
SmallMove visibleMove(const config::AxisConfig& config);
/// The move that is measured.
SmallMove measurableMove(const config::AxisConfig& config);

/// "2 mm towards plus"
std::string distanceText(const config::AxisConfig& config, double distance);

/// Why the driver will refuse this move; empty: nothing is known against it. The axis may be
/// disabled, at fault or on hold; the switch ahead may be active; a soft limit may be too near.
std::string knownRefusal(const config::AxisConfig& config, const AxisView& state, double distance);

/// Moves an axis after a question, and watches it. A line from the user stops it, and so does any
/// change of a switch, because it isn't known yet which switch is at which end.
class HandMove {
 public:
  /// All outlive this object.
  HandMove(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config)
      : dialogue_(dialogue), machine_(machine), config_(config) {}

  /// knownRefusal() of such a move in a new state of the axis.
  std::string refusalOf(double distance);
  /// Asks for no move that the driver is known to refuse: it says why instead.
  ///
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
