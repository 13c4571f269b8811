#pragma once

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

AxisTable axisTable(const Session& session, int columns, double now);

}  // namespace stepdriver::console
