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
  /// @throw Error if the expression is wrong.
  explicit Pattern(const char* expression);
  ~Pattern();
  Pattern(const Pattern&) = delete;
  Pattern& operator=(const Pattern&) = delete;

  /// The first match that begins at `from` or later, and of those the longest one.
  ///
  /// @return views of the text: the match, and then what each pair of parentheses has matched,
  ///   without data if that is no part of the match. Empty if there is no match.
  /// @throw std::bad_alloc if there isn't enough memory for it.
  std::vector<std::string_view> find(const std::string& text, std::size_t from = 0) const;

  /// Whether there is a match. With `^` and `$`, the expression must match the whole text.
  bool matches(const std::string& text) const { return !find(text).empty(); }

 private:
  regex_t compiled_{};
};

}  // namespace stepdriver
