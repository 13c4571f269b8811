#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::search {

/// Lines with an input that can't be read for some time.
class FailingReads : public gpio::Lines {
 public:
  explicit FailingReads(std::unique_ptr<gpio::Lines> lines) : lines_(std::move(lines)) {}

  /// From now on, reads of this input fail with an errno. @param input -1: all reads succeed.
  void fail(int input, int error) {
    input_ = input;
    error_ = error;
  }

  [[nodiscard]] int read(int input) noexcept override {
    return input == input_ ? -error_ : lines_->read(input);
  }
  [[nodiscard]] int write(const gpio::LineWrite* writes, std::size_t count) noexcept override {
    return lines_->write(writes, count);
  }
  [[nodiscard]] int waitForEdges(std::int64_t timeout_ns, gpio::EdgeEvent* events,
                                 std::size_t capacity) noexcept override {
    return lines_->waitForEdges(timeout_ns, events, capacity);
  }
  void interrupt() noexcept override { lines_->interrupt(); }
  const std::string& outputName(int output) const override { return lines_->outputName(output); }
  const std::string& inputName(int input) const override { return lines_->inputName(input); }

 private:
  const std::unique_ptr<gpio::Lines> lines_;
  int input_ = -1;
  int error_ = 0;
};

}  // namespace stepdriver::search
