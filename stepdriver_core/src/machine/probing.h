#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/io.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::machine {

/// @throw Refused if the numbers of a request are no probing.
void refuseBadProbing(const ProbeRequest& request);

/// How a stroke of a probing ended.
struct ProbeStrokeResult {
  LatchResult latched;  ///< of a touch
  CoordinatedResult line;
  std::vector<double> begin;    ///< [unit] where the axes stood
  std::vector<double> targets;  ///< [unit] where the line was to end
  bool was_cancelled = false;
};

/// A probing, in the thread of its caller: one touch or two, and the way back. What must not be
/// late happens in the controller: the axes come to rest at the contact.
class Probing {
 public:
  /// What the machine does for it. Both return when the axes are at rest.
  struct Means {
    /// Until the contact. The positions of the first touch are those of the request. @throw Refused
    std::function<ProbeStrokeResult(const std::vector<double>& positions, double velocity)> touch;
    /// @throw Refused
    std::function<ProbeStrokeResult(const std::vector<double>& positions)> go_back;
  };
  /// @param request outlives it.
  Probing(const ProbeRequest& request, Means means) : request_(request), means_(std::move(means)) {}

  /// @throw Refused by the first touch.
  ProbeResult run();

 private:
  bool touchFirst();
  bool touchAgain();
  /// @return whether there was a contact; if not, the result says why.
  bool take(const ProbeStrokeResult& touched, const char* which);
  bool goBack(const std::vector<double>& positions, const char* what);
  std::vector<double> placeBefore() const;
  void end(ProbeEnd end, const std::string& why);

  const ProbeRequest& request_;
  const Means means_;
  std::vector<double> begin_;    // [unit] those of the first touch
  std::vector<double> targets_;  // [unit]
  ProbeResult result_;
};

}  // namespace stepdriver::machine
