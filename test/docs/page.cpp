#include "page.h"

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace stepdriver::docs {
namespace {

std::string unquoted(const std::string& cell) {
  const bool quoted =
      cell.size() > 1 && cell.front() == '`' && cell.find('`', 1) == cell.size() - 1;
  return quoted ? cell.substr(1, cell.size() - 2) : cell;
}

Cells cellsOf(const std::string& row) {
  Cells cells;
  for (const std::string& cell : split(row.substr(1), '|'))
    cells.push_back(unquoted(trimmed(cell)));
  return cells;
}

}  // namespace

std::vector<Cells> tableRows(const std::string& page, const std::string& heading) {
  std::ifstream file(STEPDRIVER_SOURCES "/" + page);
  if (!file) throw std::runtime_error("can't read " + page);
  std::vector<Cells> rows;
  bool here = false;
  bool in_body = false;
  for (std::string line; std::getline(file, line);) {
    if (!line.empty() && line[0] == '#') here = trimmed(line.substr(line.find(' '))) == heading;
    const bool row = here && !line.empty() && line[0] == '|';
    if (row && in_body) rows.push_back(cellsOf(line));
    in_body = row && (in_body || line.rfind("|---", 0) == 0);
  }
  if (rows.empty()) throw std::runtime_error(page + " has no table under " + heading);
  return rows;
}

std::vector<std::string> expanded(const std::string& name) {
  const auto begin = name.find('{');
  if (begin == std::string::npos) return {name};
  const auto end = name.find('}', begin);
  std::vector<std::string> names;
  for (const std::string& one : split(name.substr(begin + 1, end - begin - 1), ',')) {
    names.push_back(name.substr(0, begin) + trimmed(one) + name.substr(end + 1));
  }
  return names;
}

std::string trimmed(const std::string& text) {
  const auto begin = text.find_first_not_of(' ');
  return begin == std::string::npos ? ""
                                    : text.substr(begin, text.find_last_not_of(' ') - begin + 1);
}

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, at);) parts.push_back(part);
  return parts;
}

}  // namespace stepdriver::docs
