#pragma once

#include <optional>
#include <string>

#include "keys.h"

namespace stepdriver::console {

/// The line in which the user types a position for one axis.
class PositionPrompt {
 public:
  enum class Outcome { kOpen, kEntered, kCancelled };

  explicit PositionPrompt(std::string axis) : axis_(std::move(axis)) {}

  /// Digits, signs, points and commas are typed; a backspace removes the last of them. All other
  /// keys except Enter and Escape are ignored.
  Outcome press(Key key);
  /// Whether a key can be part of a number.
  static bool takes(Key key);

  const std::string& axis() const { return axis_; }
  const std::string& text() const { return text_; }
  /// @return empty if the text isn't a number.
  std::optional<double> number() const;

 private:
  std::string axis_;
  std::string text_;
};

}  // namespace stepdriver::console
