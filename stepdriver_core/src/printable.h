#pragma once

#include <string>

namespace stepdriver {

/// Whether a text of somebody else has no control characters and no line breaks. In a message, such
/// characters would begin a line that nobody wrote, or change what a terminal shows.
bool isPrintable(const std::string& text);

/// The text with each of these characters as an escape sequence: `\n`, `\t`, `\x1b`.
std::string printable(const std::string& text);

}  // namespace stepdriver
