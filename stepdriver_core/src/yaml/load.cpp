#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>
#include <vector>

#include "scalar.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/yaml.h"

namespace stepdriver::yaml {
namespace {

using config::ConfigValue;

// Deeper than any configuration; an alias may refer to a node that contains it.
constexpr int kDeepest = 50;

class Converter {
 public:
  explicit Converter(std::string name) : name_(std::move(name)) {}

  ConfigValue convert(const YAML::Node& node, int depth = 0) {
    if (depth > kDeepest)
      fail(node.Mark(), "it is nested too deeply, or it is an alias for a node that contains it");
    switch (node.Type()) {
      case YAML::NodeType::Scalar:
        return scalar(node);
      case YAML::NodeType::Sequence: {
        ConfigValue::List list;
        for (const auto& item : node) list.push_back(convert(item, depth + 1));
        return {std::move(list)};
      }
      case YAML::NodeType::Map:
        return {map(node, depth)};
      default:
        return {};
    }
  }

  [[noreturn]] void fail(const YAML::Mark& mark, const std::string& what) const {
    throw Error(fmt::format("{}:{}:{}: {}", name_, mark.line + 1, mark.column + 1, what));
  }

 private:
  static bool isPlain(const YAML::Node& node) { return node.Tag().empty() || node.Tag() == "?"; }

  ConfigValue scalar(const YAML::Node& node) const {
    static const std::string standard = "tag:yaml.org,2002:";
    const std::string& tag = node.Tag();
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
    if (from.IsSequence()) {
      for (const auto& item : from) merge(item, depth + 1, into);
      return;
    }
    if (!from.IsMap()) fail(from.Mark(), "<< takes a map, or a list of maps");
    const ConfigValue::Map entries = map(from, depth + 1);
    into.insert(entries.begin(), entries.end());
  }

  const std::string name_;
};

}  // namespace

ConfigValue parse(const std::string& text, const std::string& name) {
  Converter converter(name);
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.empty()) return ConfigValue::Map{};
    if (documents.size() > 1) {
      converter.fail(documents[1].Mark(), "a second document begins here; only one is allowed");
    }
    const ConfigValue value = converter.convert(documents.front());
    return value.isNothing() ? ConfigValue::Map{} : value;
  } catch (const YAML::Exception& error) {
    converter.fail(error.mark, error.msg);
  }
}

ConfigValue load(const std::string& path) {
  std::error_code unknown;
  if (std::filesystem::is_directory(path, unknown)) throw Error(path + ": is a folder");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(path + ": can't be read: " + std::strerror(errno));
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  return parse(text, path);
}

setup::MachineConfig readFile(const std::string& path, setup::BackendChoice choice) {
  return setup::machineConfigOf(load(path), choice);
}

}  // namespace stepdriver::yaml
