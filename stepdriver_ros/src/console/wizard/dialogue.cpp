#include "dialogue.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>

#include "common/text.h"

namespace stepdriver::console {
namespace {

std::string trimmed(const std::string& text) {
  const auto is_space = [](unsigned char c) { return std::isspace(c) != 0; };
  const auto begin = std::find_if_not(text.begin(), text.end(), is_space);
  const auto end = std::find_if_not(text.rbegin(), text.rend(), is_space).base();
  return begin < end ? std::string(begin, end) : std::string();
}

void sayNotUnderstood(Dialogue& dialogue, const std::string& answer, const std::string& wanted) {
  dialogue.say(fmt::format("\"{}\" isn't understood: {}.", answer, wanted));
}

}  // namespace

bool askYesNo(Dialogue& dialogue, const std::string& question, bool yes_by_default) {
  for (;;) {
    const std::string answer =
        trimmed(dialogue.ask(question + (yes_by_default ? " [Y/n] " : " [y/N] ")));
    if (answer.empty()) return yes_by_default;
    if (answer == "y" || answer == "Y" || answer == "yes") return true;
    if (answer == "n" || answer == "N" || answer == "no") return false;
    sayNotUnderstood(dialogue, answer, "type y or n, or q to quit");
  }
}

std::optional<double> askNumber(Dialogue& dialogue, const std::string& question,
                                const std::string& unit) {
  const std::string shown = fmt::format("{} [{}] ", question, unit);
  for (;;) {
    const std::string answer = trimmed(dialogue.ask(shown));
    if (answer.empty()) return {};
    char* end = nullptr;
    const double number = std::strtod(answer.c_str(), &end);
    const std::string rest = trimmed(end);
    const bool whole = end != answer.c_str() && (rest.empty() || rest == unit);
    if (whole && std::isfinite(number)) return number;
    sayNotUnderstood(dialogue, answer, "it must be a number, in " + unit);
  }
}

std::optional<double> askLength(Dialogue& dialogue, const std::string& question,
                                const std::string& unit, std::optional<double> fallback) {
  const std::string shown =
      fallback ? fmt::format("{} (Enter: {})", question, ros_node::roundedText(*fallback))
               : question;
  for (;;) {
    const auto length = askNumber(dialogue, shown, unit);
    if (!length) return fallback;
    if (*length > 0.0) return length;
    dialogue.say(fmt::format("{} {} is no length: it must be above 0.",
                             ros_node::roundedText(*length), unit));
  }
}

}  // namespace stepdriver::console
