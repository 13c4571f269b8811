#include "yaml_text.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "stepdriver_core/yaml.h"

namespace stepdriver::console {
namespace {

using config::ConfigValue;

struct Entry {
  YAML::Node key;
  YAML::Node value;
};

std::optional<Entry> entryOf(const YAML::Node& map, const std::string& name) {
  if (!map.IsMap()) return {};
  for (const auto& entry : map) {
    if (entry.first.IsScalar() && entry.first.Scalar() == name)
      return Entry{entry.first, entry.second};
  }
  return {};
}

/// The last entry on this way. @param path not empty.
std::optional<Entry> find(const std::string& text, const KeyPath& path) {
  std::optional<Entry> entry = Entry{YAML::Node(), YAML::Load(text)};
  for (const std::string& name : path) {
    if (entry) entry = entryOf(entry->value, name);
  }
  return entry;
}

struct Span {
  std::size_t begin = 0;
  std::size_t size = 0;
};

std::size_t offsetOf(const std::string& text, const YAML::Node& node) {
  static const std::string byte_order_mark = "\xEF\xBB\xBF";  // yaml-cpp doesn't count it
  const std::size_t skipped = text.rfind(byte_order_mark, 0) == 0 ? byte_order_mark.size() : 0;
  return skipped + static_cast<std::size_t>(std::max(node.Mark().pos, 0));
}

/// A scalar in the text, with its quotes; nothing if it is written in another way, such as with an
/// anchor, as an alias, or over several lines.
std::optional<Span> spanOf(const std::string& text, const YAML::Node& node) {
  if (!node.IsScalar()) return {};
  const std::size_t begin = offsetOf(text, node);
  for (const std::string quote : {"", "'", "\""}) {
    const std::string written = fmt::format("{0}{1}{0}", quote, node.Scalar());
    if (!written.empty() && begin < text.size() &&
        text.compare(begin, written.size(), written) == 0) {
      return Span{begin, written.size()};
    }
  }
  return {};
}

std::string inlineText(const ConfigValue& value) {
  if (const auto* map = value.as<ConfigValue::Map>()) {
    std::string text;
    for (const auto& [key, below] : *map) {
      text += (text.empty() ? "" : ", ") + key + ": " + inlineText(below);
    }
    return "{" + text + "}";
  }
  std::string text = yaml::textOf(value);
  text.erase(text.find_last_not_of('\n') + 1);
  return text;
}

/// Replaces a part of a line; a comment behind it stays in its column as far as there is room.
std::string replaced(std::string text, const Span& span, const std::string& by) {
  const std::size_t end = span.begin + span.size;
  const std::size_t next = std::min(text.find_first_not_of(' ', end), text.size());
  std::size_t gap = next - end;
  if (gap > 0 && next < text.size() && text[next] == '#') {
    const std::size_t column = span.size + gap;
    gap = by.size() < column ? column - by.size() : 1;
  }
  return text.replace(span.begin, next - span.begin, by + std::string(gap, ' '));
}

}  // namespace

std::optional<std::string> withScalar(const std::string& text, const KeyPath& path,
                                      const ConfigValue& value) {
  const auto entry = find(text, path);
  if (!entry) return {};
  const auto span = spanOf(text, entry->value);
  if (!span) return {};
  return replaced(text, *span, inlineText(value));
}

std::optional<std::string> withNewKey(const std::string& text, const KeyPath& path,
                                      const ConfigValue& value) {
  if (path.size() < 2) return {};
  const auto parent = find(text, {path.begin(), path.end() - 1});
  if (!parent || !parent->value.IsMap() || parent->value.size() == 0) return {};
  const std::string entry = path.back() + ": " + inlineText(value);
  std::string edited = text;
  if (parent->value.Style() == YAML::EmitterStyle::Flow) {
    const std::size_t brace = offsetOf(text, parent->value);
    if (brace >= text.size() || text[brace] != '{') return {};
    return edited.insert(brace + 1, entry + ", ");
  }
  // In a line of its own, below the key of the map and above its first key.
  const std::size_t line = text.find('\n', offsetOf(text, parent->key));
  const std::size_t first = offsetOf(text, parent->value.begin()->first);
  if (line == std::string::npos || first >= text.size() || first <= line) return {};
  const std::size_t indent_begin = text.rfind('\n', first) + 1;
  const std::string indent = text.substr(indent_begin, first - indent_begin);
  if (indent.find_first_not_of(' ') != std::string::npos) return {};
  const std::string ending = line > 0 && text[line - 1] == '\r' ? "\r\n" : "\n";
  return edited.insert(line + 1, indent + entry + ending);
}

std::optional<std::string> withKeysSwapped(const std::string& text, const KeyPath& map,
                                           const std::string& one, const std::string& other) {
  const auto parent = find(text, map);
  if (!parent) return {};
  std::vector<std::pair<Span, std::string>> edits;
  for (const auto& [from, to] : {std::pair{one, other}, std::pair{other, one}}) {
    const auto entry = entryOf(parent->value, from);
    if (!entry) continue;
    const auto span = spanOf(text, entry->key);
    if (!span) return {};
    edits.emplace_back(*span, to);
  }
  // From the end, so that the places before it stay the same.
  std::sort(edits.begin(), edits.end(), [](const auto& before, const auto& after) {
    return before.first.begin > after.first.begin;
  });
  std::string edited = text;
  for (const auto& [span, to] : edits) edited.replace(span.begin, span.size, to);
  return edited;
}

}  // namespace stepdriver::console
