#pragma once

#include <string>

#include "../driver_view.h"
#include "common/background_call.h"

namespace stepdriver::console {

/// The wizard's interface to the driver. Lengths are in mm or degrees.
class MachineAtHand {
 public:
  virtual ~MachineAtHand() = default;

  /// Lets a little time pass, and handles the driver's messages meanwhile.
  virtual void wait() = 0;
  /// The number of states from the driver so far.
  virtual int states() const = 0;
  /// @throw Error if the state isn't live.
  virtual AxisView state(const std::string& axis) = 0;
  virtual client::Answer enable(const std::string& axis, bool on) = 0;
  /// Declares the position of the axis. @param position [mm|deg]
  virtual client::Answer setPosition(const std::string& axis, double position) = 0;
  /// Begins a move over this distance, and doesn't wait for its end.
  ///
  /// @param speed [mm/s|deg/s]
  virtual client::Answer move(const std::string& axis, double distance, double speed) = 0;
  virtual client::Answer stop(const std::string& axis) = 0;
};

}  // namespace stepdriver::console
