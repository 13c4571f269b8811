#include "scalar.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <optional>
#include <string>

#include "pattern.h"
#include "stepdriver_core/error.h"

namespace stepdriver::yaml {
namespace {

using config::ConfigValue;

constexpr double kPi = 3.14159265358979323846;
constexpr double kSixty = 60.0;

std::string without(const std::string& text, char unwanted) {
  std::string rest = text;
  rest.erase(std::remove(rest.begin(), rest.end(), unwanted), rest.end());
  return rest;
}

std::optional<bool> booleanOf(const std::string& text) {
  static const Pattern yes("^(yes|Yes|YES|true|True|TRUE|on|On|ON)$");
  static const Pattern no("^(no|No|NO|false|False|FALSE|off|Off|OFF)$");
  if (yes.matches(text)) return true;
  if (no.matches(text)) return false;
  return {};
}

/// 1:30 is 90, and 1:30.5 is 90.5.
double sexagesimal(const std::string& digits) {
  double value = 0.0;
  std::size_t begin = 0;
  for (;;) {
    const std::size_t colon = digits.find(':', begin);
    value = value * kSixty + std::strtod(digits.substr(begin, colon - begin).c_str(), nullptr);
    if (colon == std::string::npos) return value;
    begin = colon + 1;
  }
}

/// The sign, and what follows it.
struct Signed {
  double sign;
  std::string rest;
};

Signed signOf(const std::string& text) {
  const bool has_sign = !text.empty() && (text[0] == '-' || text[0] == '+');
  return {text[0] == '-' ? -1.0 : 1.0, has_sign ? text.substr(1) : text};
}

/// @return the number as a double, which holds every int of 32 bits exactly.
std::optional<double> integerOf(const std::string& text) {
  static const Pattern integer(
      "^[-+]?(0b[01_]+|0[0-7_]+|0|[1-9][0-9_]*|0x[0-9a-fA-F_]+|[1-9][0-9_]*(:[0-5]?[0-9])+)$");
  if (!integer.matches(text)) return {};
  const auto [sign, digits] = signOf(without(text, '_'));
  if (digits.find(':') != std::string::npos) return sign * sexagesimal(digits);
  int base = 10;
  std::string rest = digits;
  if (digits.rfind("0b", 0) == 0 || digits.rfind("0x", 0) == 0) {
    base = digits[1] == 'b' ? 2 : 16;
    rest = digits.substr(2);
  } else if (digits.size() > 1 && digits[0] == '0') {
    base = 8;
  }
  return sign * static_cast<double>(std::strtoull(rest.c_str(), nullptr, base));
}

std::optional<double> realOf(const std::string& text) {
  static const Pattern nan("^[.](nan|NaN|NAN)$");
  static const Pattern infinity("^[-+]?[.](inf|Inf|INF)$");
  static const Pattern in_sixties("^[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+[.][0-9_]*$");
  static const Pattern decimal(
      "^([-+]?[0-9][0-9_]*[.][0-9_]*([eE][-+][0-9]+)?|[.][0-9][0-9_]*([eE][-+][0-9]+)?)$");
  if (nan.matches(text)) return std::numeric_limits<double>::quiet_NaN();
  if (infinity.matches(text)) {
    return signOf(text).sign * std::numeric_limits<double>::infinity();
  }
  const bool sixties = in_sixties.matches(text);
  if (!sixties && !decimal.matches(text)) return {};
  const auto [sign, digits] = signOf(without(text, '_'));
  return sign * (sixties ? sexagesimal(digits) : std::strtod(digits.c_str(), nullptr));
}

/// Everything that strtod() accepts, with nothing after it.
std::optional<double> anyNumber(const std::string& text) {
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  if (text.empty() || end != text.c_str() + text.size()) return {};
  return number;
}

/// A number, or a product or quotient of numbers and pi.
std::optional<double> productOf(const std::string& text) {
  double product = 1.0;
  char operation = '*';
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find_first_of("*/", begin), text.size());
    const std::string word = without(text.substr(begin, end - begin), ' ');
    const auto factor = word == "pi"    ? std::optional<double>(kPi)
                        : word == "-pi" ? std::optional<double>(-kPi)
                                        : anyNumber(word);
    if (!factor) return {};
    product = operation == '*' ? product * *factor : product / *factor;
    if (end < text.size()) operation = text[end];
    begin = end + 1;
  }
  return product;
}

ConfigValue angleOf(const std::string& text) {
  const bool degrees = text[0] == 'd';
  const std::string inside = text.substr(4, text.size() - 5);
  const auto number = degrees ? anyNumber(without(inside, ' ')) : productOf(inside);
  if (!number) {
    throw Error(
        fmt::format("{} isn't an angle: it must be as {}", text,
                    degrees ? "deg(90.0)" : "rad(1.5), or as rad(2*pi/3) with * and / only"));
  }
  return {degrees ? *number * kPi / 180.0 : *number};
}

ConfigValue integerValue(double number, const std::string& text) {
  if (number < std::numeric_limits<int>::min() || number > std::numeric_limits<int>::max()) {
    throw Error(text + " is beyond the integers of ROS parameters, -2147483648 to 2147483647");
  }
  return {static_cast<int>(number)};
}

}  // namespace

ConfigValue resolveScalar(const std::string& text) {
  static const Pattern nothing("^(~|null|Null|NULL)?$");
  static const Pattern angle("^(deg|rad)[(][^)]*[)]$");
  if (nothing.matches(text)) return {};
  if (const auto flag = booleanOf(text)) return {*flag};
  if (const auto integer = integerOf(text)) return integerValue(*integer, text);
  if (const auto number = realOf(text)) return {*number};
  if (angle.matches(text)) return angleOf(text);
  return {text};
}

ConfigValue resolveTagged(const std::string& text, const std::string& type) {
  if (type == "str") return {text};
  if (type == "null") return {};
  if (type == "bool") {
    if (const auto flag = booleanOf(text)) return {*flag};
  } else if (type == "int") {
    if (const auto integer = integerOf(text)) return integerValue(*integer, text);
  } else if (type == "float") {
    const auto real = realOf(text);
    if (const auto number = real ? real : anyNumber(text)) return {*number};
  } else {
    throw Error("the tag !!" + type + " can't be a ROS parameter");
  }
  throw Error(fmt::format("{} isn't what its tag !!{} says", text, type));
}

}  // namespace stepdriver::yaml
