#pragma once

#include <string>
#include <utility>

namespace stepdriver::axis {

/// The fault of an axis, which stays until it is cleared. An emergency stop by the input stays
/// marked as such, whatever comes after it.
class Fault {
 public:
  static constexpr const char* kEmergencyStop = "emergency stop";
  static constexpr const char* kEmergencyStopInput = "emergency stop input";

  explicit operator bool() const { return !what_.empty(); }
  const std::string& what() const { return what_; }
  /// What ends it, in words; empty if there is no fault.
  const std::string& remedy() const { return remedy_; }
  bool isEmergencyStop() const { return what_ == kEmergencyStop || what_ == kEmergencyStopInput; }

  void latch(std::string what, std::string remedy) {
    what_ = std::move(what);
    remedy_ = std::move(remedy);
  }
  /// A fault of the whole machine, which makes an emergency stop: that doesn't hide the reason.
  void latchOfMachine(std::string what, std::string remedy) {
    latch(std::move(what), std::move(remedy));
    of_machine_ = true;
  }
  void latchEmergencyStop(bool by_input) {
    if (what_ == kEmergencyStopInput || (of_machine_ && !by_input)) return;
    if (by_input) {
      latch(kEmergencyStopInput, "release the button, then call recover");
    } else {
      latch(kEmergencyStop, "call recover when all is safe");
    }
  }
  void clear() {
    what_.clear();
    remedy_.clear();
    of_machine_ = false;
  }

 private:
  std::string what_;
  std::string remedy_;
  bool of_machine_ = false;
};

}  // namespace stepdriver::axis
