#pragma once

#include <diagnostic_msgs/DiagnosticStatus.h>

#include <string>

namespace diagnostic_updater {

/// In place of the package diagnostic_updater, on systems that lack it: what it would report is
/// dropped.
class DiagnosticStatusWrapper : public diagnostic_msgs::DiagnosticStatus {
 public:
  void summary(int /*level*/, const std::string& /*text*/) {}
  void mergeSummary(int /*level*/, const std::string& /*text*/) {}
  template <typename Value>
  void add(const std::string& /*key*/, const Value& /*value*/) {}
};

}  // namespace diagnostic_updater
