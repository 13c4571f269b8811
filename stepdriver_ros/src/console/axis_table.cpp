#include "axis_table.h"

#include <fmt/format.h>
#include <stepdriver/Endstops.h>

#include <algorithm>

#include "common/axis_words.h"
#include "table_units.h"

namespace stepdriver::console {
namespace {

constexpr std::size_t kGap = 1;
constexpr std::size_t kMark = 2;  // before the name: whether the axis is chosen

struct Column {
  std::string title;
  int importance = 0;     ///< the highest is dropped first if there is no room
  std::size_t width = 0;  ///< grows with the contents
  bool right_aligned = false;
  std::vector<std::string> cells;
};

std::string switchText(bool there, bool known, bool active) {
  if (!there) return "-";
  if (!known) return "?";
  return active ? Endstops::PRESSED : Endstops::OPEN;
}

std::string fitted(const std::string& text, std::size_t width, bool right_aligned) {
  const std::string shown = text.substr(0, width);
  const std::string space(width - shown.size(), ' ');
  return right_aligned ? space + shown : shown + space;
}

std::vector<Column> columnsOf(const Session& session, bool live) {
  std::vector<Column> all = {{"axis", 0, 6, false, {}},    {"position", 1, 14, true, {}},
                             {"speed", 5, 14, true, {}},   {"min end", 4, 7, false, {}},
                             {"max end", 4, 7, false, {}}, {"motor", 3, 6, false, {}},
                             {"state", 2, 12, false, {}}};
  for (const AxisView& axis : session.driver().axes()) {
    const config::AxisConfig* config = session.driver().config(axis.name);
    const std::string unit = config == nullptr ? "?" : configUnitOf(config->kind);
    const bool chosen = axis.name == session.chosen();
    const auto old = [&](const std::string& text) { return live ? text : "(" + text + ")"; };
    const std::vector<std::string> cells = {
        (chosen ? "> " : "  ") + axis.name,
        old(positionText(axis.position, unit)),
        old(fmt::format("{:.2f} {}/s", axis.velocity, unit)),
        old(switchText(config != nullptr && config->hasEndstop(false), axis.switches_known,
                       axis.min_active)),
        old(switchText(config != nullptr && config->hasEndstop(true), axis.switches_known,
                       axis.max_active)),
        old(ros_node::motorWords(axis)),
        live ? ros_node::stateWords(axis) : "STALE"};
    for (std::size_t i = 0; i < cells.size(); ++i) {
      all[i].width = std::max(all[i].width, cells[i].size());
      all[i].cells.push_back(cells[i]);
    }
  }
  return all;
}

std::size_t widthOf(const std::vector<Column>& columns) {
  std::size_t width = 0;
  for (const Column& column : columns) width += (width == 0 ? 0 : kGap) + column.width;
  return width;
}

/// Shortens the names, which come first, as far as that helps.
void shortenNames(std::vector<Column>& columns, std::size_t width) {
  Column& names = columns.front();
  const std::size_t others = widthOf(columns) - names.width;
  const std::size_t room = width > others ? width - others : 0;
  const std::size_t wanted = std::min(names.width, std::max(room, kMark + kShortName));
  for (std::string& cell : names.cells) {
    cell = cell.substr(0, kMark) + shortName(cell.substr(kMark), wanted - kMark);
  }
  names.width = wanted;
}

/// Removes the least important column. @return its title.
std::string dropOne(std::vector<Column>& columns) {
  const auto least = std::max_element(
      columns.begin(), columns.end(),
      [](const Column& one, const Column& other) { return one.importance < other.importance; });
  std::string title = least->title;
  columns.erase(least);
  return title;
}

std::string rowText(const std::vector<Column>& columns, int index) {
  std::string text;
  for (const Column& column : columns) {
    if (!text.empty()) text += std::string(kGap, ' ');
    const std::string& cell = index < 0 ? column.title : column.cells[index];
    text += fitted(index < 0 && &column == &columns.front() ? "  " + cell : cell, column.width,
                   column.right_aligned);
  }
  return text;
}

}  // namespace

std::string shortName(const std::string& name, std::size_t width) {
  if (name.size() <= width || width < 3) return name.substr(0, width);
  const std::size_t end = (width - 1) / 2;
  return name.substr(0, width - 1 - end) + "~" + name.substr(name.size() - end);
}

AxisTable axisTable(const Session& session, int columns, double now) {
  std::vector<Column> shown = columnsOf(session, session.driver().live(now));
  AxisTable table;
  shortenNames(shown, static_cast<std::size_t>(columns));
  while (shown.size() > 1 && widthOf(shown) > static_cast<std::size_t>(columns)) {
    table.hidden.push_back(dropOne(shown));
  }
  table.titles.text = rowText(shown, -1);
  const auto& axes = session.driver().axes();
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (axes[i].name == session.chosen()) table.chosen = static_cast<int>(i);
    table.rows.push_back({rowText(shown, static_cast<int>(i)), !axes[i].fault.empty()});
  }
  return table;
}

}  // namespace stepdriver::console
