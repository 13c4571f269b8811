#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace stepdriver {

/// The base of all stepdriver errors. what() is a whole sentence for the person who reads it.
///
/// @code{.cpp}
/// try {
///   machine.axis("x").moveTo(0.05);  // [m]
/// } catch (const Error& error) {
///   std::cerr << error.what() << "\n";  // "x: the axis is disabled"
/// }
/// @endcode
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A command that can't be accepted at the moment. It has changed nothing.
class Refused : public Error {
 public:
  /// @param message may quote what the client sent: what() shows its control characters and line
  ///   breaks as printable() does.
  explicit Refused(const std::string& message);
};

/// A GPIO line can't be requested, written or read; names the line and the reason.
class GpioError : public Error {
 public:
  using Error::Error;
};

/// The computer has nothing left for what is needed, such as another thread.
class ExhaustedError : public Error {
 public:
  using Error::Error;
};

/// The positions of the axes couldn't be written to the state file; names the file and the reason.
class StateFileError : public Error {
 public:
  using Error::Error;
};

/// One mistake in a configuration.
struct ConfigIssue {
  std::string key;  ///< full name of the parameter
  /// Its value and what is allowed; continues the sentence that the key begins.
  std::string message;
  /// The parameter should not be there, or contradicts another one. It may be left over from an
  /// earlier configuration.
  bool may_be_left_over = false;
};

/// All mistakes in a configuration.
class ConfigError : public Error {
 public:
  explicit ConfigError(std::vector<ConfigIssue> issues);

  const std::vector<ConfigIssue>& issues() const { return issues_; }

 private:
  std::vector<ConfigIssue> issues_;
};

}  // namespace stepdriver
