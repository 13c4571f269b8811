#pragma once

#include <string>
#include <vector>

namespace stepdriver::console {

/// Cuts a text into lines of at most so many characters, between words where it can; lines after
/// the first are indented by two where there is room. What isn't printable ASCII becomes `?`.
std::vector<std::string> wrapped(const std::string& text, int columns);

}  // namespace stepdriver::console
