#include "stepdriver_core/error.h"

#include <utility>

#include "printable.h"

namespace stepdriver {
namespace {

std::string linesOf(const std::vector<ConfigIssue>& issues) {
  std::string text;
  for (const ConfigIssue& issue : issues) {
    if (!text.empty()) text += '\n';
    text += issue.key + ": " + issue.message;
  }
  return text;
}

}  // namespace

Refused::Refused(const std::string& message) : Error(printable(message)) {}

ConfigError::ConfigError(std::vector<ConfigIssue> issues)
    : Error(linesOf(issues)), issues_(std::move(issues)) {}

}  // namespace stepdriver
