#pragma once

#include <string>
#include <vector>

namespace stepdriver::docs {

using Cells = std::vector<std::string>;

/// The rows of the tables under one heading of a page, without their head; no quotes (`) in cells
/// where they stand round all of one.
std::vector<Cells> tableRows(const std::string& page, const std::string& heading);

/// `a/{b,c}` as a/b and a/c.
std::vector<std::string> expanded(const std::string& name);

/// Without what is before and behind it.
std::string trimmed(const std::string& text);

/// At each of these letters.
std::vector<std::string> split(const std::string& text, char at);

}  // namespace stepdriver::docs
