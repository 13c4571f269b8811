#pragma once

#include <optional>
#include <string>

#include "stepdriver_core/error.h"

namespace stepdriver::console {

/// The person has ended the dialogue.
class Ended : public Error {
 public:
  using Error::Error;
};

/// Questions and answers, line by line.
class Dialogue {
 public:
  virtual ~Dialogue() = default;

  virtual void say(const std::string& text) = 0;
  /// @return the next line. @throw Ended where the person ends the dialogue.
  virtual std::string ask(const std::string& question) = 0;
  /// The next line where it has come; to be called often while something is waited for.
  ///
  /// @throw Ended as ask().
  virtual std::optional<std::string> line() = 0;
  /// The same while something moves. Lines that were written beforehand don't count.
  virtual std::optional<std::string> lineOfAHand() = 0;
};

/// @param yes_by_default what an empty line means.
bool askYesNo(Dialogue& dialogue, const std::string& question, bool yes_by_default);

/// @param unit for the question; the answer may have it too.
/// @return none: an empty line.
std::optional<double> askNumber(Dialogue& dialogue, const std::string& question,
                                const std::string& unit);

/// The same of a length above 0.
///
/// @param fallback what an empty line means.
std::optional<double> askLength(Dialogue& dialogue, const std::string& question,
                                const std::string& unit, std::optional<double> fallback = {});

}  // namespace stepdriver::console
