#include "wrapped.h"

#include <algorithm>

namespace stepdriver::console {
namespace {

// A window narrower than this has no room for indentation.
constexpr int kRoomToIndent = 20;

}  // namespace

std::vector<std::string> wrapped(const std::string& text, int columns) {
  std::string rest = text;
  for (char& c : rest) {
    if (c < ' ' || c > '~') c = c == '\n' || c == '\t' ? ' ' : '?';
  }
  const std::string indent(columns > kRoomToIndent ? 2 : 0, ' ');
  const auto width = static_cast<std::size_t>(std::max(columns, 1));
  std::vector<std::string> lines;
  while (rest.size() > width) {
    std::size_t end = rest.rfind(' ', width);
    if (end == std::string::npos || end <= indent.size()) end = width;
    lines.push_back(rest.substr(0, end));
    const std::size_t next = rest.find_first_not_of(' ', end);
    if (next == std::string::npos) return lines;
    rest.replace(0, next, indent);
  }
  lines.push_back(rest);
  return lines;
}

}  // namespace stepdriver::console
