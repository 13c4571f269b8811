#pragma once

#include <regex.h>

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace stepdriver {

/// A POSIX extended regular expression (regex(7)), for texts of any length. std::regex of GNU's
/// library needs stack for each character: a text of some ten thousand ends the program.
///
/// Any thread may use one at any time.
class Pattern {
 public:
  /// @throw std::invalid_argument if the expression is wrong.
  explicit Pattern(const char* expression);
  ~Pattern();
  Pattern(const Pattern&) = delete;
  Pattern& operator=(const Pattern&) = delete;

  /// The first match that begins at `from` or later, and of those the longest one.
  ///
  /// @return the match, and then what each pair of parentheses has matched, without data if that
  /// isn't
  ///   part of the match; all are views of the text. Empty if there is no match.
  std::vector<std::string_view> find(const std::string& text, std::size_t from = 0) const;

  bool matches(const std::string& text) const { return !find(text).empty(); }

 private:
  regex_t compiled_{};
};

}  // namespace stepdriver
