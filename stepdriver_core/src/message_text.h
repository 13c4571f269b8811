#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stepdriver {

/// An exact number as a person would write it: 0.1, 1000000, 1e+300. The same in every locale.
std::string numberText(double number);

/// The same with six digits, which are enough for computed values.
std::string roughText(double number);

/// A time with three digits: "2.5 ms".
std::string millisecondsText(std::int64_t nanoseconds);

/// A positive bound with six digits, rounded to the allowed side: a user who enters the bound from
/// a message must not get another message.
std::string lowerBoundText(double bound);
std::string upperBoundText(double bound);

/// "a, b or c"; the joining word can be another.
std::string listText(const std::vector<std::string>& words, const std::string& joint = "or");

/// "a, b, c": the text of each element.
template <typename Elements, typename TextOf>
std::string joinedText(const Elements& elements, const TextOf& text_of) {
  std::string text;
  for (const auto& element : elements) text += (text.empty() ? "" : ", ") + text_of(element);
  return text;
}

/// @return the word of which this one may be an abbreviation or a misspelling; nullptr if none is
///   close enough. Of two misspellings at the same distance, the first.
const std::string* nearest(const std::string& word, const std::vector<std::string>& words);

}  // namespace stepdriver
