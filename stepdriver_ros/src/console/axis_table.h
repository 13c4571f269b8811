#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "screen.h"

namespace stepdriver::console {

/// The axes, one per row, below a row of titles.
struct AxisTable {
  Row titles;
  std::vector<Row> rows;
  int chosen = 0;                   ///< index of the chosen axis's row
  std::vector<std::string> hidden;  ///< titles of the columns that didn't fit
};

/// The width of a name in lines that have no room for more.
constexpr std::size_t kShortName = 12;

/// The name if it fits, and otherwise its beginning and its end: `gantry~left`.
std::string shortName(const std::string& name, std::size_t width);

AxisTable axisTable(const Session& session, int columns, double now);

}  // namespace stepdriver::console
