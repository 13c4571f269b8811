#include "position_prompt.h"

#include <cmath>
#include <cstddef>
#include <cstdlib>

namespace stepdriver::console {
namespace {

constexpr std::size_t kLongest = 16;  // characters; more than any position has

}  // namespace

bool PositionPrompt::takes(Key key) {
  return (key >= '0' && key <= '9') || key == '+' || key == '-' || key == '.' || key == ',' ||
         key == kKeyBackspace;
}

PositionPrompt::Outcome PositionPrompt::press(Key key) {
  if (key == kKeyEscape) return Outcome::kCancelled;
  if (key == kKeyEnter) return Outcome::kEntered;
  if (key == kKeyBackspace) {
    if (!text_.empty()) text_.pop_back();
  } else if (takes(key) && text_.size() < kLongest) {
    text_ += static_cast<char>(key);
  }
  return Outcome::kOpen;
}

std::optional<double> PositionPrompt::number() const {
  char* end = nullptr;
  const double number = std::strtod(text_.c_str(), &end);
  if (end == text_.c_str() || *end != '\0' || !std::isfinite(number)) return {};
  return number;
}

}  // namespace stepdriver::console
