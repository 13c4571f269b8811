#pragma once

#include <string>
#include <vector>

namespace stepdriver::check {

/// Rows of words, in columns as wide as their widest word; each row is indented by two.
std::string table(const std::vector<std::vector<std::string>>& rows);

}  // namespace stepdriver::check
