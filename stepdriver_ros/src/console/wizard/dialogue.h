#pragma once

#include <optional>
#include <string>

#include "stepdriver_core/error.h"

namespace stepdriver::console {

/// The user has ended the dialogue.
class Ended : public Error {
 public:
  using Error::Error;
};

/// Questions and answers, line by line.
class Dialogue {
 public:
  virtual ~Dialogue() = default;

  virtual void say(const std::string& text) = 0;
  /// @return the next line. @throw Ended if the user ends the dialogue.
  virtual std::string ask(const std::string& question) = 0;
  /// The next line, if there is one. Call it often while waiting for something.
  ///
  /// @throw Ended as ask().
  virtual std::optional<std::string> line() = 0;
  /// The same while something moves. Lines that were entered before don't count.
  virtual std::optional<std::string> lineOfAHand() = 0;
};

/// @param yes_by_default the meaning of an empty line.
bool askYesNo(Dialogue& dialogue, const std::string& question, bool yes_by_default);

/// @param unit for the question; the answer may contain it too.
/// @return empty for an empty line.
std::optional<double> askNumber(Dialogue& dialogue, const std::string& question,
                                const std::string& unit);

/// The same for a length above 0.
///
/// @param fallback the meaning of an empty line.
std::optional<double> askLength(Dialogue& dialogue, const std::string& question,
                                const std::string& unit, std::optional<double> fallback = {});

}  // namespace stepdriver::console
