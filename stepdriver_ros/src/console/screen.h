#pragma once

#include <string>
#include <vector>

#include "session.h"

namespace stepdriver::console {

/// A row of the screen. What is loud stands out where the terminal can do that; its text says all
/// the same without.
struct Row {
  std::string text;
  bool loud = false;
};

/// What the screen shows: at most so many rows, each of at most so many ASCII characters. What
/// doesn't fit is left out by its importance, and a row says so.
///
/// @param rows, columns of the window; at least 1.
std::vector<Row> draw(const Session& session, int rows, int columns, double now);

}  // namespace stepdriver::console
