#include "printable.h"

#include <fmt/format.h>

#include <cstddef>
#include <string_view>

namespace stepdriver {
namespace {

/// How many bytes of UTF-8 the control character or line break here has; 0: another character.
std::size_t controlLength(const std::string& text, std::size_t at) {
  const auto byte = [&](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const unsigned first = byte(at);
  if (first < 0x20 || first == 0x7f) return 1;
  // U+0080 to U+009F
  if (first == 0xc2 && byte(at + 1) >= 0x80 && byte(at + 1) <= 0x9f) return 2;
  // U+2028 and U+2029, which separate lines and paragraphs
  const bool separates = byte(at + 1) == 0x80 && (byte(at + 2) == 0xa8 || byte(at + 2) == 0xa9);
  return first == 0xe2 && separates ? 3 : 0;
}

std::string escaped(std::string_view character) {
  if (character == "\n") return "\\n";
  if (character == "\r") return "\\r";
  if (character == "\t") return "\\t";
  std::string text;
  for (const char byte : character) {
    text += fmt::format("\\x{:02x}", static_cast<unsigned char>(byte));
  }
  return text;
}

}  // namespace

bool isPrintable(const std::string& text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (controlLength(text, i) > 0) return false;
  }
  return true;
}

std::string printable(const std::string& text) {
  std::string result;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = controlLength(text, i);
    if (length == 0) {
      result += text[i++];
    } else {
      result += escaped(std::string_view(text).substr(i, length));
      i += length;
    }
  }
  return result;
}

}  // namespace stepdriver
