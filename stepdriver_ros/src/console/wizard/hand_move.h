#pragma once

#include "dialogue.h"
#include "machine_at_hand.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// Small and slow, for a machine that nothing is known of yet.
struct SmallMove {
  double distance = 0.0;  ///< [mm|deg]
  double speed = 0.0;     ///< [mm/s|deg/s]
};

/// To see which way it goes.
SmallMove visibleMove(const config::AxisConfig& config);
/// To measure it.
SmallMove measurableMove(const config::AxisConfig& config);

/// Moves an axis after a question, and watches it: a line of the person, and any switch that
/// changes, stop it, as nobody knows yet which switch is at which end.
class HandMove {
 public:
  /// All outlive this object.
  HandMove(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config)
      : dialogue_(dialogue), machine_(machine), config_(config) {}

  /// @param move its distance is negative towards minus.
  /// @return [mm|deg] how far it went, as counted; 0: it didn't, or not to its end.
  double ask(const SmallMove& move);

 private:
  double watch(double start);
  void rest();
  /// The next state that the driver says, and not one that was under way.
  AxisView freshState();

  Dialogue& dialogue_;
  MachineAtHand& machine_;
  const config::AxisConfig& config_;
};

}  // namespace stepdriver::console
