#include "message_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numeric>

namespace stepdriver {
namespace {

constexpr int kRoughDigits = 6;

/// The number of digits that survive the conversion to text and back. Printing and reading use the
/// same locale, so it doesn't matter.
int digitsOf(double number) {
  for (const int digits : {15, 16}) {
    char text[40];
    std::snprintf(text, sizeof text, "%.*g", digits, number);
    if (std::strtod(text, nullptr) == number) return digits;
  }
  return 17;
}

double roughly(double number, double (*round)(double)) {
  if (number == 0.0 || !std::isfinite(number)) return number;
  const int place = static_cast<int>(std::floor(std::log10(std::abs(number)))) + 1 - kRoughDigits;
  // Powers of ten below 1 are not exact: divide by those above.
  const double power = std::pow(10.0, std::abs(place));
  const double rounded = place < 0 ? round(number * power) / power : round(number / power) * power;
  return std::isfinite(rounded) ? rounded : number;
}

/// How many letters must be changed, inserted, removed or swapped with their neighbour.
std::size_t distance(const std::string& from, const std::string& to) {
  std::vector<std::size_t> before(to.size() + 1);
  std::vector<std::size_t> last(to.size() + 1);
  std::vector<std::size_t> row(to.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= from.size(); ++i) {
    before = last;
    last = row;
    row[0] = i;
    for (std::size_t j = 1; j <= to.size(); ++j) {
      const std::size_t changed = last[j - 1] + (from[i - 1] == to[j - 1] ? 0 : 1);
      row[j] = std::min({changed, last[j] + 1, row[j - 1] + 1});
      if (i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1]) {
        row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
  }
  return row.back();
}

bool isBeginOf(const std::string& word, const std::string& candidate) {
  return !word.empty() && candidate.compare(0, word.size(), word) == 0;
}

/// Whether letters were left out of its words, but not the first ones: "accel_mm" and
/// "acceleration_mm_s2".
bool isAbbreviationOf(const std::string& word, const std::string& candidate) {
  bool begins = true;
  std::size_t at = 0;
  for (const char letter : word) {
    if (begins || letter == '_') {
      if (!begins) at = candidate.find('_', at);
      if (at >= candidate.size() || candidate[at] != letter) return false;
    } else {
      while (at < candidate.size() && candidate[at] != letter && candidate[at] != '_') ++at;
      if (at >= candidate.size() || candidate[at] != letter) return false;
    }
    begins = letter == '_';
    ++at;
  }
  return word.size() > 1;
}

/// The only word that is meant; nullptr if there is none, or several.
template <typename IsMeant>
const std::string* onlyOne(const std::vector<std::string>& words, const IsMeant& is_meant) {
  const std::string* found = nullptr;
  for (const std::string& candidate : words) {
    if (!is_meant(candidate)) continue;
    if (found != nullptr) return nullptr;
    found = &candidate;
  }
  return found;
}

}  // namespace

std::string numberText(double number) { return fmt::format("{:.{}g}", number, digitsOf(number)); }

std::string roughText(double number) {
  return numberText(roughly(number, [](double scaled) { return std::round(scaled); }));
}

std::string millisecondsText(std::int64_t nanoseconds) {
  return fmt::format("{:.3g} ms", static_cast<double>(nanoseconds) * 1e-6);
}

// The slack keeps a bound that is a round number except for its last bit.
std::string lowerBoundText(double bound) {
  return numberText(roughly(bound, [](double scaled) { return std::ceil(scaled - 1e-5); }));
}

std::string upperBoundText(double bound) {
  return numberText(roughly(bound, [](double scaled) { return std::floor(scaled + 1e-5); }));
}

std::string listText(const std::vector<std::string>& words, const std::string& joint) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) text += i + 1 < words.size() ? ", " : " " + joint + " ";
    text += words[i];
  }
  return text;
}

const std::string* nearest(const std::string& word, const std::vector<std::string>& words) {
  for (const auto& shortens : {isBeginOf, isAbbreviationOf}) {
    if (const std::string* meant = onlyOne(
            words, [&](const std::string& candidate) { return shortens(word, candidate); })) {
      return meant;
    }
  }
  const std::string* best = nullptr;
  // A misspelling has a letter in common with the word, at least.
  std::size_t best_distance = std::min(std::max<std::size_t>(2, word.size() / 2) + 1,
                                       std::max<std::size_t>(word.size(), 1));
  for (const std::string& candidate : words) {
    const std::size_t candidate_distance = distance(word, candidate);
    if (candidate_distance < best_distance) {
      best = &candidate;
      best_distance = candidate_distance;
    }
  }
  return best;
}

}  // namespace stepdriver
