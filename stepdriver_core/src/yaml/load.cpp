#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "printable.h"
#include "scalar.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/yaml.h"

namespace stepdriver::yaml {
namespace {

using config::ConfigValue;

// Deeper than any configuration; an alias may refer to a node that contains it.
constexpr int kDeepest = 50;
// Each is many times more than a configuration of a hundred axes has. Aliases of aliases could
// stand for more values than any computer has memory for.
constexpr std::size_t kLargest = std::size_t{1} << 20;
constexpr int kMostValues = 20'000;
constexpr std::size_t kLongestText = 4096;

std::string tooLarge(const std::string& name) {
  return fmt::format("{}: is larger than {} bytes, the most that a configuration may have", name,
                     kLargest);
}

/// How many bytes the character here has in UTF-8; 0: these bytes aren't UTF-8.
std::size_t characterLength(const std::string& text, std::size_t at) {
  const auto byte = [&](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const unsigned first = byte(at);
  if (first < 0x80) return 1;
  const std::size_t length = first < 0xc2 ? 0 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : 4;
  if (length == 0 || first > 0xf4) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if (byte(at + i) < 0x80 || byte(at + i) > 0xbf) return 0;
  }
  // Characters with fewer bytes, halves of pairs of UTF-16, and what is above U+10FFFF.
  const unsigned second = byte(at + 1);
  const bool wrong = (first == 0xe0 && second < 0xa0) || (first == 0xed && second > 0x9f) ||
                     (first == 0xf0 && second < 0x90) || (first == 0xf4 && second > 0x8f);
  return wrong ? 0 : length;
}

/// White space and line breaks are control characters too, but YAML knows them.
bool isText(const std::string& character) {
  static const std::set<std::string> spaces = {"\t",       "\n",           "\r",
                                               "\xc2\x85", "\xe2\x80\xa8", "\xe2\x80\xa9"};
  return isPrintable(character) || spaces.count(character) != 0;
}

/// As YAML and PyYAML require. yaml-cpp would take a text with null characters for UTF-16 or
/// UTF-32.
void refuseUnlessText(const std::string& text, const std::string& name) {
  int line = 1;
  int column = 1;
  for (std::size_t at = 0; at < text.size(); ++column) {
    const std::size_t length = characterLength(text, at);
    if (length == 0 || !isText(text.substr(at, length))) {
      throw Error(
          fmt::format("{}:{}:{}: the byte 0x{:02x} is no text: a configuration is UTF-8 "
                      "without control characters",
                      name, line, column, static_cast<unsigned char>(text[at])));
    }
    if (text[at] == '\n') {
      ++line;
      column = 0;
    }
    at += length;
  }
}

/// The place of the first value of a document.
class FirstMark : public YAML::EventHandler {
 public:
  std::optional<YAML::Mark> mark;

  void OnDocumentStart(const YAML::Mark& /*mark*/) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& at, YAML::anchor_t /*anchor*/) override { note(at); }
  void OnAlias(const YAML::Mark& at, YAML::anchor_t /*anchor*/) override { note(at); }
  void OnScalar(const YAML::Mark& at, const std::string& /*tag*/, YAML::anchor_t /*anchor*/,
                const std::string& /*value*/) override {
    note(at);
  }
  void OnSequenceStart(const YAML::Mark& at, const std::string& /*tag*/, YAML::anchor_t /*anchor*/,
                       YAML::EmitterStyle::value /*style*/) override {
    note(at);
  }
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark& at, const std::string& /*tag*/, YAML::anchor_t /*anchor*/,
                  YAML::EmitterStyle::value /*style*/) override {
    note(at);
  }
  void OnMapEnd() override {}

 private:
  void note(const YAML::Mark& at) {
    if (!mark) mark = at;
  }
};

/// The place of a second document; no value if there is none. YAML::LoadAll() would find it too,
/// but it never ends if the text continues with something that can't begin a document, as in `, a`.
std::optional<YAML::Mark> secondDocument(const std::string& text) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  FirstMark first;
  FirstMark second;
  if (parser.HandleNextDocument(first)) parser.HandleNextDocument(second);
  return second.mark;
}

/// The place of a tab that indents the line of a mistake; no value if none does. yaml-cpp takes
/// what follows for a part of the line before it, and complains of that.
std::optional<YAML::Mark> tabBefore(const std::string& text, const YAML::Mark& mistake) {
  std::istringstream lines(text);
  std::string line;
  for (int i = 0; i <= mistake.line && std::getline(lines, line); ++i) {
  }
  const std::size_t tab = line.find('\t');
  if (tab == std::string::npos || line.find_first_not_of(" \t") < tab) return {};
  YAML::Mark mark = mistake;
  mark.column = static_cast<int>(tab);
  return mark;
}

class Converter {
 public:
  explicit Converter(std::string name) : name_(std::move(name)) {}

  ConfigValue convert(const YAML::Node& node, int depth = 0) {
    checkDepth(node, depth);
    countValue(node);
    switch (node.Type()) {
      case YAML::NodeType::Scalar:
        return scalar(node);
      case YAML::NodeType::Sequence: {
        ConfigValue::List list;
        for (const auto& item : node) list.push_back(convert(item, depth + 1));
        return {std::move(list)};
      }
      case YAML::NodeType::Map:
        return orderedMap(node, depth);
      default:
        return {};
    }
  }

  [[noreturn]] void fail(const YAML::Mark& mark, const std::string& what) const {
    throw Error(
        fmt::format("{}:{}:{}: {}", name_, mark.line + 1, mark.column + 1, printable(what)));
  }

 private:
  void checkDepth(const YAML::Node& node, int depth) const {
    if (depth > kDeepest)
      fail(node.Mark(), "it is nested too deeply, or it is an alias for a node that contains it");
  }

  void countValue(const YAML::Node& node) {
    if (++values_ <= kMostValues) return;
    fail(node.Mark(), fmt::format("there are more than {} values up to here, each alias counted as "
                                  "the values that it stands for",
                                  kMostValues));
  }

  static bool isPlain(const YAML::Node& node) { return node.Tag().empty() || node.Tag() == "?"; }

  ConfigValue scalar(const YAML::Node& node) const {
    static const std::string standard = "tag:yaml.org,2002:";
    const std::string& tag = node.Tag();
    if (node.Scalar().size() > kLongestText) {
      fail(node.Mark(), fmt::format("a text of {} characters is too long, at most {} are allowed",
                                    node.Scalar().size(), kLongestText));
    }
    try {
      if (isPlain(node)) return resolveScalar(node.Scalar());
      if (tag == "!") return {node.Scalar()};  // quoted
      if (tag.rfind(standard, 0) == 0) {
        return resolveTagged(node.Scalar(), tag.substr(standard.size()));
      }
    } catch (const Error& error) {
      fail(node.Mark(), error.what());
    }
    fail(node.Mark(), "the tag " + tag + " can't be a ROS parameter");
  }

  // A plain `on` or 7 isn't a string for PyYAML, so rosparam couldn't load the file.
  std::string keyOf(const YAML::Node& node) const {
    const ConfigValue key = scalar(node);
    if (const auto* word = key.as<std::string>()) return *word;
    fail(node.Mark(), fmt::format("the key {} is read as {}, but must be a word: put it in quotes",
                                  node.Scalar(), key.shown()));
  }

  ConfigValue orderedMap(const YAML::Node& node, int depth) {
    ConfigValue value(map(node, depth));
    std::vector<std::string> keys;
    for (const auto& entry : node) keys.push_back(entry.first.Scalar());
    value.setKeyOrder(std::move(keys));
    return value;
  }

  ConfigValue::Map map(const YAML::Node& node, int depth) {
    ConfigValue::Map result;
    ConfigValue::Map merged;
    for (const auto& entry : node) {
      if (!entry.first.IsScalar()) fail(entry.first.Mark(), "a key must be a word");
      const std::string key = keyOf(entry.first);
      if (key == "<<" && isPlain(entry.first)) {
        merge(entry.second, depth, merged);
      } else if (!result.emplace(key, convert(entry.second, depth + 1)).second) {
        fail(entry.first.Mark(), "the key " + key + " occurs twice");
      }
    }
    result.insert(merged.begin(), merged.end());
    return result;
  }

  void merge(const YAML::Node& from, int depth, ConfigValue::Map& into) {
    checkDepth(from, depth);
    countValue(from);
    if (from.IsSequence()) {
      for (const auto& item : from) merge(item, depth + 1, into);
      return;
    }
    if (!from.IsMap()) fail(from.Mark(), "<< takes a map, or a list of maps");
    const ConfigValue::Map entries = map(from, depth + 1);
    into.insert(entries.begin(), entries.end());
  }

  const std::string name_;
  int values_ = 0;
};

}  // namespace

ConfigValue parse(const std::string& text, const std::string& name) {
  if (text.size() > kLargest) throw Error(tooLarge(name));
  refuseUnlessText(text, name);
  Converter converter(name);
  try {
    if (const auto second = secondDocument(text)) {
      converter.fail(*second, "a second document begins here; only one is allowed");
    }
    const ConfigValue value = converter.convert(YAML::Load(text));
    return value.isNothing() ? ConfigValue::Map{} : value;
  } catch (const YAML::Exception& error) {
    if (const auto tab = tabBefore(text, error.mark)) {
      converter.fail(*tab, "the line is indented by a tab; YAML takes only spaces for that");
    }
    converter.fail(error.mark, error.msg);
  }
}

ConfigValue load(const std::string& path) {
  std::error_code unknown;
  if (std::filesystem::is_directory(path, unknown)) throw Error(path + ": is a folder");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(path + ": can't be read: " + std::strerror(errno));
  std::string text(kLargest + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (file.bad()) throw Error(path + ": can't be read: " + std::strerror(errno));
  return parse(text, path);
}

setup::MachineConfig readFile(const std::string& path, setup::BackendChoice choice) {
  return setup::machineConfigOf(load(path), choice);
}

}  // namespace stepdriver::yaml
