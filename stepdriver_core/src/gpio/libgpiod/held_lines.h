#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "gpiod_calls.h"
#include "priority_mutex.h"
#include "stepdriver_core/gpio/lines.h"

struct pollfd;

namespace stepdriver::gpio::gpiod {

/// The outputs on one chip, in one kernel request.
struct OutputGroup {
  std::unique_ptr<Outputs> request;
  LineBits levels = 0;    // their last levels
  PriorityMutex mutex{};  // guards both
};

/// The inputs on one chip.
struct InputGroup {
  std::unique_ptr<Inputs> request;
  std::vector<int> inputs;  // maps indices in this group to indices in the whole request
  PriorityMutex mutex{};    // guards the request
};

/// The place of a line of the whole request.
struct Seat {
  std::size_t group;
  std::size_t index;
};

struct OutputSeat {
  Seat seat;
  bool safe_level;
  bool keep_on_release;
};

/// Requested lines, for any version of libgpiod.
class HeldLines : public Lines {
 public:
  /// The parts, in the reverse order of destruction: lines must be released before their chips.
  struct Parts {
    std::vector<std::unique_ptr<Chip>> chips;
    std::vector<std::unique_ptr<InputGroup>> input_groups;
    std::vector<std::unique_ptr<OutputGroup>> output_groups;
    std::vector<OutputSeat> outputs;
    std::vector<Seat> inputs;
    std::vector<std::string> output_names;
    std::vector<std::string> input_names;
  };

  /// @throw GpioError if the kernel has no eventfd left.
  explicit HeldLines(Parts&& parts);
  ~HeldLines() override;

  int write(const LineWrite* writes, std::size_t count) noexcept override;
  int read(int input) noexcept override;
  int waitForEdges(std::int64_t timeout_ns, EdgeEvent* events,
                   std::size_t capacity) noexcept override;
  void interrupt() noexcept override;
  const std::string& outputName(int output) const override;
  const std::string& inputName(int input) const override;
  std::size_t outputChip(int output) const override;

 private:
  struct EdgeSource {
    InputGroup* group;
    std::size_t fd;  // index among the group's file descriptors
  };

  /// Sets the writes that are on the same chip as the first.
  int writeGroup(const LineWrite* writes, std::size_t count) noexcept;
  const Seat& seatOf(const LineWrite& write) const noexcept;
  static int takeEdges(const EdgeSource& source, EdgeEvent* events, std::size_t capacity) noexcept;

  Parts parts_;
  int interrupt_fd_;
  std::vector<pollfd> polled_;  // the interrupt, then one for each source
  std::vector<EdgeSource> sources_;
};

}  // namespace stepdriver::gpio::gpiod
