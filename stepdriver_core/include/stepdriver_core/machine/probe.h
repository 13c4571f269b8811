#pragma once

#include <string>
#include <vector>

/// Motions that end where an input changes.
///
/// @code{.cpp}
/// machine::ProbeRequest request;
/// request.input = "probe";
/// request.names = {"z"};
/// request.positions = {-0.02};  // [m] the farthest
/// request.velocity = 0.005;     // [m/s]
/// const double z = machine.probe(request).contact.front();
/// @endcode
namespace stepdriver::machine {

/// A probing: a straight line until an input with a name tells of a contact.
struct ProbeRequest {
  std::string input;
  std::vector<std::string> names;  ///< the axes' names, each once
  /// [unit] Where the line ends without a contact, one for each name.
  std::vector<double> positions;
  bool relative = false;
  bool away = false;      ///< the contact is where the input becomes inactive, not active
  bool must = true;       ///< without a contact it has failed
  double velocity = 0.0;  ///< as of motion::LineRequest; 0: as fast as the limits of the axes allow
  /// A second touch at this velocity, from back_off before the first contact; 0: none.
  double second_velocity = 0.0;
  double back_off = 0.0;  ///< [unit] along the line; above 0 for a second touch
  bool returns = false;   ///< at the end the axes stand at the contact, not where they came to rest
};

/// How a probing ended.
enum class ProbeEnd {
  kContact,
  kNoContact,
  kCancelled,
  kFailed,  ///< something else ended it: a stop, a fault, an endstop, another command
};

/// What a probing has found, and where the axes stand after it.
struct ProbeResult {
  ProbeEnd end = ProbeEnd::kFailed;
  bool succeeded = false;         ///< there was a contact, or it need not be
  std::string message;            ///< a sentence that says how it ended
  std::vector<double> contact;    ///< [unit] of the last touch; empty if there was none
  std::vector<double> positions;  ///< [unit] where the axes stand
};

}  // namespace stepdriver::machine
