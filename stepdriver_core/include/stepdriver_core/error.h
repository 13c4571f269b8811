#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace stepdriver {

/// What every stepdriver error is. what() is a whole sentence for the person who reads it.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A command that can't be accepted as things stand. Nothing was changed by it.
class Refused : public Error {
 public:
  using Error::Error;
};

/// A GPIO line that can't be had, written or read; names the line and the reason.
class GpioError : public Error {
 public:
  using Error::Error;
};

/// One thing wrong in a configuration.
struct ConfigIssue {
  std::string key;      ///< full name of the parameter
  std::string message;  ///< its value and what is allowed; reads on from the key
};

/// Everything that is wrong in a configuration, all at once.
class ConfigError : public Error {
 public:
  explicit ConfigError(std::vector<ConfigIssue> issues);

  const std::vector<ConfigIssue>& issues() const { return issues_; }

 private:
  std::vector<ConfigIssue> issues_;
};

}  // namespace stepdriver
