#include "stepdriver_core/gpio/simulated_lines.h"

#include <fmt/format.h>

#include <cerrno>
#include <unordered_map>
#include <utility>

#include "edge_queue.h"
#include "stepdriver_core/error.h"

namespace stepdriver::gpio {

// NOLINTNEXTLINE(performance-unnecessary-value-param): a board that knows its edges keeps it
void Board::watchInput(int /*line*/, EdgeListener /*listener*/) {}

void Board::onWriteEnd(std::int64_t /*time_ns*/) {}

bool Board::hasSerial(const std::string& /*port*/) const { return false; }

std::vector<std::uint8_t> Board::onBytes(const std::string& /*port*/, const std::uint8_t* /*bytes*/,
                                         std::size_t /*count*/, bool /*pause*/,
                                         std::int64_t /*time_ns*/) {
  return {};
}

struct SimulatedBackend::Shared {
  Shared(Board& wired_board, TimeSource time_source)
      : board(wired_board), now(std::move(time_source)) {}

  Board& board;
  const TimeSource now;
  std::mutex mutex;  // serializes the calls of the board, and so their times
  std::unordered_map<std::string, std::string> held;  // line -> kind of request that holds it
};

class SimulatedBackend::HeldLines : public Lines {
 public:
  HeldLines(std::shared_ptr<Shared> shared, const std::vector<OutputRequest>& outputs,
            const std::vector<InputRequest>& inputs)
      : shared_(std::move(shared)) {
    Board& board = shared_->board;
    outputs_.reserve(outputs.size());
    for (const OutputRequest& output : outputs) {
      outputs_.push_back({output, board.lineIndex(output.line), output.safe_level});
    }
    inputs_.reserve(inputs.size());
    for (const InputRequest& input : inputs) {
      const int index = static_cast<int>(inputs_.size());
      inputs_.push_back({input, board.lineIndex(input.line)});
      if (!input.edges) continue;
      board.watchInput(inputs_.back().line, [this, index](bool level, std::int64_t time_ns) {
        edges_.add({index, level, time_ns});
      });
    }
  }

  /// Reports to the board the levels that the request gave the outputs.
  void begin() {
    const std::int64_t time_ns = shared_->now();
    for (const Output& output : outputs_) {
      shared_->board.onRequest(output.line, output.level, time_ns);
    }
    shared_->board.onWriteEnd(time_ns);
  }

  ~HeldLines() override {
    const std::lock_guard<std::mutex> lock(shared_->mutex);
    const std::int64_t time_ns = shared_->now();
    for (Output& output : outputs_) {
      if (!output.request.keep_on_release) drive(output, output.request.safe_level, time_ns);
    }
    shared_->board.onWriteEnd(time_ns);
    for (const Output& output : outputs_) {
      shared_->board.onRelease(output.line, time_ns);
      shared_->held.erase(output.request.line);
    }
    for (const Input& input : inputs_) {
      if (input.request.edges) shared_->board.watchInput(input.line, nullptr);
      shared_->held.erase(input.request.line);
    }
  }

  int write(const LineWrite* writes, std::size_t count) noexcept override {
    const std::lock_guard<std::mutex> lock(shared_->mutex);
    const std::int64_t time_ns = shared_->now();
    for (std::size_t i = 0; i < count; ++i) {
      if (!has(outputs_, writes[i].output)) return EINVAL;
    }
    for (std::size_t i = 0; i < count; ++i) {
      const int error = shared_->board.writeFault(outputOf(writes[i]).line, time_ns);
      if (error != 0) return error;
    }
    for (std::size_t i = 0; i < count; ++i) drive(outputOf(writes[i]), writes[i].level, time_ns);
    shared_->board.onWriteEnd(time_ns);
    return 0;
  }

  int read(int input) noexcept override {
    const std::lock_guard<std::mutex> lock(shared_->mutex);
    if (!has(inputs_, input)) return -EINVAL;
    const int line = inputs_[static_cast<std::size_t>(input)].line;
    return shared_->board.inputLevel(line, shared_->now()) ? 1 : 0;
  }

  int waitForEdges(std::int64_t timeout_ns, EdgeEvent* events,
                   std::size_t capacity) noexcept override {
    return capacity == 0 ? -EINVAL : edges_.pop(timeout_ns, events, capacity);
  }

  void interrupt() noexcept override { edges_.interrupt(); }

  const std::string& outputName(int output) const override {
    return outputs_.at(static_cast<std::size_t>(output)).request.line;
  }
  const std::string& inputName(int input) const override {
    return inputs_.at(static_cast<std::size_t>(input)).request.line;
  }

 private:
  struct Output {
    OutputRequest request;
    int line;  // the board's index
    bool level;
  };
  struct Input {
    InputRequest request;
    int line;
  };

  template <typename Items>
  static bool has(const Items& items, int index) {
    return index >= 0 && static_cast<std::size_t>(index) < items.size();
  }

  Output& outputOf(const LineWrite& write) {
    return outputs_[static_cast<std::size_t>(write.output)];
  }

  void drive(Output& output, bool level, std::int64_t time_ns) {
    if (output.level == level) return;
    output.level = level;
    shared_->board.onEdge(output.line, level, time_ns);
  }

  const std::shared_ptr<Shared> shared_;
  std::vector<Output> outputs_;
  std::vector<Input> inputs_;
  EdgeQueue edges_;
};

SimulatedBackend::SimulatedBackend(Board& board, TimeSource now)
    : shared_(std::make_shared<Shared>(board, std::move(now))) {}

SimulatedBackend::~SimulatedBackend() = default;

Backend::SerialExchange SimulatedBackend::simulatedSerial(const std::string& port) {
  if (!shared_->board.hasSerial(port)) return {};
  return [shared = shared_, port](const std::uint8_t* bytes, std::size_t count, bool pause) {
    const std::lock_guard<std::mutex> lock(shared->mutex);
    return shared->board.onBytes(port, bytes, count, pause, shared->now());
  };
}

std::unique_ptr<Lines> SimulatedBackend::request(const std::vector<OutputRequest>& outputs,
                                                 const std::vector<InputRequest>& inputs) {
  std::unique_ptr<HeldLines> lines;  // outlives the lock, which its destructor would take again
  const std::lock_guard<std::mutex> lock(shared_->mutex);

  std::unordered_map<std::string, std::string> wanted;
  const auto want = [&](const std::string& line, const char* use) {
    const auto earlier = shared_->held.find(line);
    if (earlier != shared_->held.end()) {
      throw GpioError(
          fmt::format("Line {} is busy (EBUSY): an earlier request still holds it as an {}. "
                      "Release that request first, or name another line.",
                      line, earlier->second));
    }
    const auto twin = wanted.emplace(line, use);
    if (!twin.second) {
      throw GpioError(
          fmt::format("Line {} is named twice in one request (EBUSY), as an {} and as an {}. Name "
                      "each line once.",
                      line, twin.first->second, use));
    }
  };
  for (const OutputRequest& output : outputs) want(output.line, "output");
  for (const InputRequest& input : inputs) want(input.line, "input");

  lines = std::make_unique<HeldLines>(shared_, outputs, inputs);
  shared_->held.merge(wanted);
  lines->begin();
  return lines;
}

}  // namespace stepdriver::gpio
