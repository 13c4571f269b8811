#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stepdriver {

/// A number as a person would write it, and exactly: 0.1, 1000000, 1e+300. The same in every
/// locale.
std::string numberText(double number);

/// The same with six digits, which are enough for what was computed.
std::string roughText(double number);

/// A time with three digits: "2.5 ms".
std::string millisecondsText(std::int64_t nanoseconds);

/// A positive bound with six digits, rounded to the side that is allowed: whoever writes what a
/// message names must not get another message.
std::string lowerBoundText(double bound);
std::string upperBoundText(double bound);

/// "a, b or c"; the joining word can be another.
std::string listText(const std::vector<std::string>& words, const std::string& joint = "or");

/// @return the word that this one is a slip of the keyboard from; nullptr where all are too far.
///   Of two at the same distance, the first.
const std::string* nearest(const std::string& word, const std::vector<std::string>& words);

}  // namespace stepdriver
