#pragma once

#include <string>
#include <vector>

namespace stepdriver::console {

/// Splits a text into lines of at most this many characters, between words if possible; lines after
/// the first are indented by two if there is room. Characters other than printable ASCII become
/// `?`.
std::vector<std::string> wrapped(const std::string& text, int columns);

}  // namespace stepdriver::console
