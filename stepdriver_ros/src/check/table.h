#pragma once

#include <string>
#include <vector>

namespace stepdriver::check {

/// Rows of words, in columns that are as wide as their widest word; each row indented by two.
std::string table(const std::vector<std::vector<std::string>>& rows);

}  // namespace stepdriver::check
