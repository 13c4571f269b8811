#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::test {

/// Passes everything on to other lines, for tests that change one of their calls.
class PassingLines : public gpio::Lines {
 public:
  explicit PassingLines(std::unique_ptr<gpio::Lines> lines) : lines_(std::move(lines)) {}

  int write(const gpio::LineWrite* writes, std::size_t count) noexcept override {
    return lines_->write(writes, count);
  }
  gpio::LateWrites lateWrites(int output) const noexcept override {
    return lines_->lateWrites(output);
  }
  int read(int input) noexcept override { return lines_->read(input); }
  int waitForEdges(std::int64_t timeout_ns, gpio::EdgeEvent* events,
                   std::size_t capacity) noexcept override {
    return lines_->waitForEdges(timeout_ns, events, capacity);
  }
  void interrupt() noexcept override { lines_->interrupt(); }
  const std::string& outputName(int output) const override { return lines_->outputName(output); }
  const std::string& inputName(int input) const override { return lines_->inputName(input); }
  std::size_t outputChip(int output) const override { return lines_->outputChip(output); }

 private:
  std::unique_ptr<gpio::Lines> lines_;
};

}  // namespace stepdriver::test
