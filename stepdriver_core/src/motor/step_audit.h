#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace stepdriver::motor {

/// Compares the count of the steps that were sent with MSCNT, in which a chip counts those that it
/// has heard, modulo 4 full steps. Whether MSCNT grows with the count depends on the wiring: the
/// first motion shows it.
class StepAudit {
 public:
  /// MSCNT at this count of a motor. Later values are compared with it.
  void begin(int mscnt, std::int64_t count);
  /// Counts have another meaning, or the chip has lost its own: check() begins again.
  void end() { begun_ = false; }

  /// @param microsteps the mode since begin(). @pre The motor and the chip are at rest.
  /// @return the difference in words; empty if there is none.
  std::string check(int mscnt, std::int64_t count, int microsteps);

  /// 1: MSCNT grows with the count; -1: against it; 0: not known yet.
  int direction() const { return sign_; }

  /// What MSCNT must be at this count; empty if that isn't known.
  std::optional<int> mscntAt(std::int64_t count, int microsteps) const;

 private:
  bool begun_ = false;
  int mscnt_ = 0;
  std::int64_t count_ = 0;
  int sign_ = 0;  // 0: not known yet
};

}  // namespace stepdriver::motor
