#pragma once

#include <string>
#include <vector>

#include "findings.h"

namespace stepdriver::console {

/// The text of a configuration file with corrected values. Everything else stays as it is:
/// comments, the order of the keys, blank lines.
struct CorrectedText {
  std::string text;
  /// If one of the changes can't be made in the text, it is unchanged, and these are all changes,
  /// to be made by hand: `axes/x/invert/dir: true`. Otherwise empty.
  std::vector<std::string> by_hand;
};

/// Makes the changes of corrected() in the text of a file. Switches that are swapped keep their
/// comments, because only their keys `min` and `max` change.
///
/// @param text a configuration that yaml::parse() can read.
CorrectedText correctedText(const std::string& text, const std::vector<Findings>& findings);

}  // namespace stepdriver::console
