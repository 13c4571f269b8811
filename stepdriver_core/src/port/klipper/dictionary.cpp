#include "port/klipper/dictionary.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

namespace stepdriver::klipper {
namespace {

using Json = nlohmann::json;

// The largest dictionaries have about 60 kB.
constexpr std::size_t kMostUnpacked = 4'000'000;
// A range of pins in an enumeration.
constexpr std::uint32_t kMostInRange = 10'000;
constexpr std::size_t kShownPins = 12;

[[noreturn]] void refuse(const std::string& why) {
  throw BoardError("the board's description of its firmware can't be read: " + why);
}

std::int32_t idOf(const std::string& name, const Json& value) {
  if (!value.is_number_integer()) refuse(fmt::format("the message {} has no number", name));
  const auto id = value.get<std::int64_t>();
  if (id < std::numeric_limits<std::int16_t>::min() ||
      id > std::numeric_limits<std::int16_t>::max()) {
    refuse(fmt::format("the message {} has the number {}", name, id));
  }
  return static_cast<std::int32_t>(id);
}

std::string nameOf(const std::string& format) { return format.substr(0, format.find(' ')); }

const Json& part(const Json& tree, const char* name) {
  static const Json none = Json::object();
  const auto found = tree.find(name);
  if (found == tree.end()) return none;
  if (!found->is_object()) refuse(fmt::format("{} is no map", name));
  return *found;
}

std::uint32_t smallNumber(const Json& value, const std::string& name) {
  if (!value.is_number_integer()) refuse(fmt::format("{} has no number", name));
  const auto number = value.get<std::int64_t>();
  if (number < 0 || number > std::numeric_limits<std::int32_t>::max()) {
    refuse(fmt::format("{} has the number {}", name, number));
  }
  return static_cast<std::uint32_t>(number);
}

// `gpio0: [0, 30]` means gpio0 to gpio29 with the numbers from 0 on.
template <typename Add>
void readEnumeration(const Json& values, const Add& add) {
  for (const auto& [name, value] : values.items()) {
    if (!value.is_array()) {
      add(name, smallNumber(value, name));
      continue;
    }
    if (value.size() != 2) refuse(name + " is no range");
    const std::uint32_t first = smallNumber(value[0], name);
    const std::uint32_t count = smallNumber(value[1], name);
    if (count > kMostInRange) refuse(fmt::format("{} is a range of {}", name, count));
    const std::size_t digits = name.find_last_not_of("0123456789") + 1;
    std::uint32_t begin = 0;
    const auto read = std::from_chars(name.data() + digits, name.data() + name.size(), begin);
    if (read.ec != std::errc{} || begin > kMostInRange) refuse(name + " has no number at its end");
    for (std::uint32_t i = 0; i < count; ++i) {
      add(fmt::format("{}{}", name.substr(0, digits), begin + i), first + i);
    }
  }
}

}  // namespace

MessageFormat messageFormat(const std::string& text) {
  MessageFormat format{text, {}};
  for (std::size_t at = text.find('='); at != std::string::npos; at = text.find('=', at + 1)) {
    const std::string kind = text.substr(at + 1, text.find(' ', at) - at - 1);
    if (kind == "%c" || kind == "%u" || kind == "%i" || kind == "%hu" || kind == "%hi") {
      format.parameters.push_back(ParameterKind::kInteger);
    } else if (kind == "%s" || kind == "%*s" || kind == "%.*s") {
      format.parameters.push_back(ParameterKind::kBytes);
    } else {
      refuse(fmt::format("the message \"{}\" has a parameter of the kind {}", text, kind));
    }
  }
  return format;
}

Dictionary Dictionary::unpacked(const std::vector<std::uint8_t>& compressed) {
  std::string json;
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) refuse("zlib has no memory");
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast): zlib's type; it only reads
  stream.next_in = const_cast<Bytef*>(compressed.data());
  stream.avail_in = static_cast<uInt>(compressed.size());
  int result = Z_OK;
  while (result == Z_OK && json.size() < kMostUnpacked) {
    char piece[4096];
    stream.next_out = reinterpret_cast<Bytef*>(piece);
    stream.avail_out = sizeof(piece);
    result = inflate(&stream, Z_NO_FLUSH);
    json.append(piece, sizeof(piece) - stream.avail_out);
  }
  inflateEnd(&stream);
  if (result != Z_STREAM_END) refuse(fmt::format("{} bytes are no zlib stream", compressed.size()));
  return parsed(json);
}

Dictionary Dictionary::parsed(const std::string& json) {
  Dictionary dictionary;
  try {
    const Json tree = Json::parse(json);
    if (!tree.is_object()) refuse("it is no map");
    if (const auto version = tree.find("version"); version != tree.end()) {
      dictionary.version_ = version->get<std::string>();
    }
    for (const auto& [format, id] : part(tree, "commands").items()) {
      dictionary.commands_[format] = idOf(format, id);
    }
    for (const char* kind : {"responses", "output"}) {
      for (const auto& [format, id] : part(tree, kind).items()) {
        // Outputs are free texts with parameters anywhere. They aren't ours: they only have to be
        // skipped, which ends the frame if it can't be done.
        MessageFormat known{format, {}};
        if (kind[0] == 'r') known = messageFormat(format);
        dictionary.responses_[idOf(format, id)] = std::move(known);
      }
    }
    for (const auto& [name, value] : part(tree, "config").items()) {
      dictionary.constants_[name] = value.is_string() ? value.get<std::string>() : value.dump();
    }
    const Json& enumerations = part(tree, "enumerations");
    readEnumeration(part(enumerations, "pin"), [&](const std::string& name, std::uint32_t number) {
      dictionary.pins_[name] = number;
    });
    for (const auto& [text, number] : part(enumerations, "static_string_id").items()) {
      if (number.is_number_integer()) dictionary.texts_[smallNumber(number, text)] = text;
    }
  } catch (const Json::exception& error) {
    refuse(error.what());
  }
  return dictionary;
}

std::optional<std::int32_t> Dictionary::command(const std::string& format) const {
  const auto found = commands_.find(format);
  if (found == commands_.end()) return std::nullopt;
  return found->second;
}

std::string Dictionary::otherFormat(const std::string& format) const {
  const std::string name = nameOf(format);
  for (const auto& [other, id] : commands_) {
    if (nameOf(other) == name && other != format) return other;
  }
  return "";
}

std::optional<std::uint64_t> Dictionary::number(const std::string& constant) const {
  const auto found = constants_.find(constant);
  if (found == constants_.end()) return std::nullopt;
  std::uint64_t value = 0;
  const std::string& digits = found->second;
  const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  // CLOCK_FREQ may be written as 16000000.0.
  const bool whole = read.ec == std::errc{} &&
                     std::string(read.ptr, digits.data() + digits.size()).find_first_not_of(".0") ==
                         std::string::npos;
  if (!whole) return std::nullopt;
  return value;
}

std::string Dictionary::text(const std::string& constant) const {
  const auto found = constants_.find(constant);
  return found == constants_.end() ? "" : found->second;
}

std::optional<std::uint32_t> Dictionary::pin(const std::string& name) const {
  const auto found = pins_.find(name);
  if (found == pins_.end()) return std::nullopt;
  return found->second;
}

std::string Dictionary::pinNames() const {
  std::string names;
  std::size_t shown = 0;
  for (const auto& [name, number] : pins_) {
    if (shown++ == kShownPins) return names + " ...";
    names += (names.empty() ? "" : ", ") + name;
  }
  return names;
}

std::string Dictionary::staticText(std::uint32_t number) const {
  const auto found = texts_.find(number);
  return found == texts_.end() ? fmt::format("reason {}", number) : found->second;
}

}  // namespace stepdriver::klipper
