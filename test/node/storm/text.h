#pragma once

#include <cstdio>
#include <string>

namespace stepdriver::storm {

/// @param format of printf, for one number.
inline std::string formatted(const char* format, double number) {
  char text[64];
  std::snprintf(text, sizeof text, format, number);
  return text;
}

}  // namespace stepdriver::storm
