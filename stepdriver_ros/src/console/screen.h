#pragma once

#include <string>
#include <vector>

#include "session.h"

namespace stepdriver::console {

/// A row of the screen. A loud row stands out if the terminal supports that; its text is complete
/// without it.
struct Row {
  std::string text;
  bool loud = false;
};

/// The contents of the screen: at most this many rows, each of at most this many ASCII characters.
/// If something doesn't fit, the least important parts are left out, and a row says so.
///
/// @param rows, columns size of the window, at least 1.
std::vector<Row> draw(const Session& session, int rows, int columns, double now);

}  // namespace stepdriver::console
