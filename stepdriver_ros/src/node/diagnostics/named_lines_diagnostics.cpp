#include "named_lines_diagnostics.h"

#include <fmt/format.h>

#include <string>

#include "common/io_words.h"

namespace stepdriver::ros_node {

void reportNamedLines(const machine::IoStates& states,
                      diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Status = diagnostic_updater::DiagnosticStatusWrapper;
  status.summary(Status::OK, "as they were switched");
  const auto add = [&](const std::string& name, const std::string& text, const std::string& error) {
    if (!error.empty()) status.mergeSummary(Status::ERROR, error);
    status.add(name, error.empty() ? text : text + " (uncertain)");
  };
  for (const machine::OutputState& output : states.outputs) {
    if (!output.note.empty()) {
      status.mergeSummary(Status::WARN, fmt::format("{} {}", output.name, output.note));
    }
    add("output " + output.name, outputWords(output.on, output.value), output.error);
  }
  for (const machine::InputState& input : states.inputs) {
    add("input " + input.name, input.active ? "active" : "inactive", input.error);
  }
}

}  // namespace stepdriver::ros_node
