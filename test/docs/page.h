#pragma once

#include <string>
#include <vector>

namespace stepdriver::docs {

using Cells = std::vector<std::string>;

/// The rows of the tables under one heading of a page, without the head. Quotes (`) around a whole
/// cell are removed.
std::vector<Cells> tableRows(const std::string& page, const std::string& heading);

/// Expands `a/{b,c}` to a/b and a/c.
std::vector<std::string> expanded(const std::string& name);

/// Without blanks at both ends.
std::string trimmed(const std::string& text);

/// Splits at each of these letters.
std::vector<std::string> split(const std::string& text, char at);

}  // namespace stepdriver::docs
