#pragma once

#include <string>

#include "../driver_view.h"
#include "common/background_call.h"

namespace stepdriver::console {

/// The driver, as the wizard uses it. Lengths are in mm or degrees.
class MachineAtHand {
 public:
  virtual ~MachineAtHand() = default;

  /// Lets a little time pass, and takes what the driver has said meanwhile.
  virtual void wait() = 0;
  /// How often the driver has said its state so far.
  virtual int states() const = 0;
  /// @throw Error where the state isn't live.
  virtual AxisView state(const std::string& axis) = 0;
  virtual client::Answer enable(const std::string& axis, bool on) = 0;
  /// Declares where the axis stands. @param position [mm|deg]
  virtual client::Answer setPosition(const std::string& axis, double position) = 0;
  /// Begins a move by this distance, and doesn't wait for its end.
  ///
  /// @param speed [mm/s|deg/s]
  virtual client::Answer move(const std::string& axis, double distance, double speed) = 0;
  virtual client::Answer stop(const std::string& axis) = 0;
};

}  // namespace stepdriver::console
