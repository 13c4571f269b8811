#include "port/klipper/board_backend.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <mutex>
#include <optional>
#include <set>
#include <thread>
#include <utility>

#include "gpio/edge_queue.h"
#include "port/klipper/board_port.h"
#include "pulse/mailbox.h"

namespace stepdriver::klipper {
namespace {

using gpio::EdgeEvent;
using gpio::LineWrite;

// How often the levels of inputs are asked for.
constexpr Nanoseconds kInputPeriod = 20'000'000;
constexpr std::size_t kMostWrites = 256;  // that wait for the thread of the port
constexpr std::size_t kMostBaseWrites = 64;
constexpr auto kReleaseLook = std::chrono::milliseconds(1);
constexpr int kMostReleaseLooks = 1'000;

}  // namespace

class BoardBackend::HeldLines final : public gpio::Lines {
 public:
  struct Output {
    std::string name;
    Board* board = nullptr;  // nullptr: it is one of the base
    std::uint32_t pin = 0;
    bool safe_level = false;
    bool keeps = false;
    std::optional<std::uint32_t> oid;  // unless it is STEP or DIR
    int base = -1;
  };
  struct Input {
    std::string name;
    Board* board = nullptr;
    std::uint32_t pin = 0;
    bool pull_up = false;
    bool edges = false;
    std::uint32_t oid = 0;
    int base = -1;
    std::atomic<int> level{0};
  };

  struct Write {
    LineWrite line{};
    std::uint64_t resumed = 0;  // Board::resumed() then
  };

  HeldLines(BoardBackend& backend, std::vector<std::unique_ptr<Board>> boards)
      : backend_(backend), boards_(std::move(boards)) {}

  ~HeldLines() override {
    for (const Output& output : outputs_) {
      if (output.oid && !output.keeps && output.board->failure() == 0) {
        output.board->setOutput(*output.oid, output.safe_level);
      }
    }
    for (const auto& board : boards_) board->flush();
    if (backend_.held_ == this) backend_.held_ = nullptr;
  }

  void hold(const std::vector<gpio::OutputRequest>& outputs,
            const std::vector<gpio::InputRequest>& inputs) {
    std::vector<gpio::OutputRequest> base_outputs;
    std::vector<gpio::InputRequest> base_inputs;
    std::set<std::string> names;
    const auto once = [&](const std::string& name) {
      if (names.insert(name).second) return;
      throw BoardError(
          fmt::format("Line {} is named twice. Each pin needs a line of its own.", name));
    };
    for (const gpio::OutputRequest& request : outputs) {
      Output output;
      output.name = request.line;
      output.safe_level = request.safe_level;
      output.keeps = request.keep_on_release;
      if (Board* board = boardOf(request.line)) {
        once(request.line);
        output.board = board;
        output.pin = board->pin(pinOf(request.line));
      } else {
        output.base = static_cast<int>(base_outputs.size());
        base_outputs.push_back(request);
      }
      outputs_.push_back(std::move(output));
    }
    for (const gpio::InputRequest& request : inputs) {
      inputs_.push_back(std::make_unique<Input>());
      Input& input = *inputs_.back();
      input.name = request.line;
      input.edges = request.edges;
      if (Board* board = boardOf(request.line)) {
        once(request.line);
        if (request.bias == Bias::kPullDown) {
          throw BoardError(fmt::format(
              "Line {}: the board can only pull it up, and not down; use a resistor", input.name));
        }
        input.board = board;
        input.pin = board->pin(pinOf(request.line));
        input.pull_up = request.bias == Bias::kPullUp;
      } else {
        input.base = static_cast<int>(base_inputs.size());
        base_inputs_.push_back(static_cast<int>(inputs_.size()) - 1);
        base_inputs.push_back(request);
      }
    }
    if (!base_outputs.empty() || !base_inputs.empty()) {
      base_ = backend_.base_.request(base_outputs, base_inputs);
    }
  }

  int write(const LineWrite* writes, std::size_t count) noexcept override {
    std::array<LineWrite, kMostBaseWrites> base{};
    std::size_t base_count = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (!has(outputs_, writes[i].output)) return EINVAL;
      const Output& output = outputs_[static_cast<std::size_t>(writes[i].output)];
      if (output.board == nullptr) {
        if (base_count == base.size()) return EINVAL;
        base[base_count++] = {output.base, writes[i].level, writes[i].part};
        continue;
      }
      if (output.board->failure() != 0) return output.board->failure();
      if (!output.oid) {
        // STEP and DIR belong to the board, which keeps them at rest by itself.
        if (writes[i].level != output.safe_level) return EINVAL;
        continue;
      }
      const std::lock_guard<std::mutex> lock(writers_);
      if (!writes_.push({writes[i], output.board->resumed()})) return EBUSY;
    }
    if (base_count != count) backend_.clock_.wake();
    return base_count == 0 ? 0 : base_->write(base.data(), base_count);
  }
  gpio::LateWrites lateWrites(int output) const noexcept override {
    const Output& line = outputs_[static_cast<std::size_t>(output)];
    return line.board == nullptr ? base_->lateWrites(line.base) : gpio::LateWrites{};
  }

  int read(int input) noexcept override {
    if (!has(inputs_, input)) return -EINVAL;
    const Input& line = *inputs_[static_cast<std::size_t>(input)];
    if (line.board == nullptr) return base_->read(line.base);
    if (line.board->failure() != 0) return -line.board->failure();
    return line.level.load(std::memory_order_relaxed);
  }

  int waitForEdges(std::int64_t timeout_ns, EdgeEvent* events,
                   std::size_t capacity) noexcept override {
    if (capacity == 0) return -EINVAL;
    if (!base_) return edges_.pop(timeout_ns, events, capacity);
    const int own = edges_.pop(0, events, capacity);
    if (own != 0) return own;
    const int count = base_->waitForEdges(timeout_ns, events, capacity);
    for (int i = 0; i < count; ++i) {
      events[i].input = base_inputs_[static_cast<std::size_t>(events[i].input)];
    }
    return count != 0 ? count : edges_.pop(0, events, capacity);
  }

  void interrupt() noexcept override {
    edges_.interrupt();
    if (base_) base_->interrupt();
  }

  const std::string& outputName(int output) const override {
    const Output& line = outputs_.at(static_cast<std::size_t>(output));
    return line.board != nullptr ? line.name : base_->outputName(line.base);
  }
  const std::string& inputName(int input) const override {
    const Input& line = *inputs_.at(static_cast<std::size_t>(input));
    return line.board != nullptr ? line.name : base_->inputName(line.base);
  }
  std::string failureText(bool input, int line) const override {
    const auto index = static_cast<std::size_t>(line);
    const Board* board = input ? inputs_.at(index)->board : outputs_.at(index).board;
    if (board != nullptr) return board->reason();
    return base_->failureText(input, input ? inputs_.at(index)->base : outputs_.at(index).base);
  }
  std::size_t outputChip(int output) const override {
    const Output& line = outputs_.at(static_cast<std::size_t>(output));
    if (line.board == nullptr) return base_->outputChip(line.base);
    // Behind all chips of the base: their numbers are small.
    constexpr std::size_t kFirstBoard = 1'000;
    std::size_t number = kFirstBoard;
    for (const auto& board : boards_) {
      if (board.get() == line.board) return number;
      ++number;
    }
    return number;
  }
  std::unique_ptr<pulse::StepPort> makePort(const std::vector<pulse::ChannelConfig>& lanes) {
    std::vector<BoardPort::Channel> channels;
    channels.reserve(lanes.size());
    std::set<int> steps;
    for (const pulse::ChannelConfig& lane : lanes) channels.push_back(channelOf(lane, steps));
    for (Output& output : outputs_) {
      if (output.board == nullptr || steps.count(indexOf(output)) != 0) continue;
      output.oid = output.board->addOutput(output.pin, output.safe_level, !output.keeps);
    }
    BoardPort::Options options;
    options.horizon = 0;
    std::vector<Board*> boards;
    for (std::size_t i = 0; i < boards_.size(); ++i) {
      boards_[i]->configure();
      boards.push_back(boards_[i].get());
      options.horizon = std::max(options.horizon, backend_.settings_[i].ahead);
      options.step_error = std::max(options.step_error, backend_.settings_[i].step_error);
    }
    for (Board* board : boards) readInputs(*board);
    auto port = std::make_unique<BoardPort>(
        boards, backend_.clock_, std::move(channels), options, [this] { sendWrites(); },
        [this](const Board& board, const Heard& heard, Nanoseconds now) {
          hear(board, heard, now);
        });
    port_ = port.get();
    return port;
  }

  void restore() {
    const std::lock_guard<std::mutex> lock(restoring_);
    for (const auto& each : boards_) {
      Board& board = *each;
      if (board.failure() == 0) continue;
      try {
        awaitRelease(board);
        board.reopen();
        port_->prepare(board);
        readInputs(board);
        board.resume();
        backend_.clock_.wake();
      } catch (const Error& error) {
        board.stayFailed(error.what());
      }
    }
  }

 private:
  template <typename Items>
  static bool has(const Items& items, int index) {
    return index >= 0 && static_cast<std::size_t>(index) < items.size();
  }
  int indexOf(const Output& output) const { return static_cast<int>(&output - outputs_.data()); }

  Board* boardOf(const std::string& line) const {
    const std::string name = line.substr(0, line.find(':'));
    if (name.size() == line.size()) return nullptr;
    for (const auto& board : boards_) {
      if (board->name() == name) return board.get();
    }
    return nullptr;
  }
  /// Until the thread that has seen the failure doesn't use the board any more.
  void awaitRelease(Board& board) const {
    for (int i = 0; !board.isReleased(); ++i) {
      if (i == kMostReleaseLooks) {
        throw BoardError(fmt::format("the board {} is still in use", board.name()));
      }
      backend_.clock_.wake();
      std::this_thread::sleep_for(kReleaseLook);
    }
  }

  void readInputs(Board& board) {
    for (const auto& input : inputs_) {
      if (input->board != &board) continue;
      const Heard state =
          board.ask(Command::kEndstopQueryState, {input->oid}, Answer::kEndstopState);
      input->level = state.arguments[3] != 0 ? 1 : 0;
    }
  }

  static std::string pinOf(const std::string& line) { return line.substr(line.find(':') + 1); }

  // ---- the port ----

  BoardPort::Channel channelOf(const pulse::ChannelConfig& lane, std::set<int>& steps) {
    BoardPort::Channel channel;
    if (!lane.patterns.empty()) {
      refuse(outputs_.at(static_cast<std::size_t>(lane.coils.front().line)).name,
             "switches a coil, but the other motors are on boards, which play pulses only");
    }
    const Output& step = outputs_.at(static_cast<std::size_t>(lane.step.line));
    channel.line = lane.step.line;
    channel.board = step.board;
    if (step.board == nullptr) {
      refuse(step.name,
             "is on no board, but other motors are: the steps of all motors must be on "
             "boards, or of none");
    }
    if (lane.dir_steps) refuse(step.name, "is a CW input, which a board can't drive");
    if (lane.block) refuse(step.name, "is on a board, where no homing can go to a block");
    if (lane.both_edges) refuse(step.name, "steps at both edges, which isn't done on a board");
    Board& board = *step.board;
    channel.pulse_ticks = board.ticksOf(std::max(lane.step_high, lane.dir_hold));
    channel.low = lane.step_low;
    channel.turn = lane.dir_setup;
    channel.trsync = board.addTrsync();
    addMotor(lane, 0, board, channel, steps);
    for (std::size_t i = 0; i < lane.twins.size(); ++i) {
      const pulse::MotorSignals& twin = lane.twins[i];
      if (twin.endstop_min || twin.endstop_max) {
        refuse(outputs_.at(static_cast<std::size_t>(twin.step.line)).name,
               "has a switch of its own: the motors of an axis on a board can't be squared");
      }
      addMotor(twin, i + 1, board, channel, steps);
    }
    if (lane.switch_release > 0.0) {
      refuse(step.name,
             "is on a board, which can't tell at which end a switch of both is pressed: "
             "its ends need a line each");
    }
    addSwitch(lane.endstop_min, pulse::EndReason::kEndstopMin, -1, 0, board, channel);
    addSwitch(lane.endstop_max, pulse::EndReason::kEndstopMax, 1, 0, board, channel);
    if (lane.ramps_at_fault) {
      refuse(step.name, "is on a board, which stops at once at a fault: leave out fault_stop");
    }
    return channel;
  }

  void addMotor(const pulse::MotorSignals& motor, std::size_t number, Board& board,
                BoardPort::Channel& channel, std::set<int>& steps) {
    const Output& step = outputs_.at(static_cast<std::size_t>(motor.step.line));
    const Output& dir = outputs_.at(static_cast<std::size_t>(motor.dir.line));
    if (step.board != &board) refuse(step.name, "isn't on the board of the axis's first motor");
    if (dir.board != &board) refuse(dir.name, "isn't on the board of its STEP line, " + step.name);
    if (!steps.insert(motor.step.line).second) {
      refuse(step.name, "moves several axes, as on a CoreXY: that can't be on a board");
    }
    steps.insert(motor.dir.line);
    channel.motors.push_back(
        {board.addStepper(step.pin, dir.pin, !motor.step.active, channel.pulse_ticks),
         motor.dir.active});
    addSwitch(motor.fault, pulse::EndReason::kChipFault, 0, number, board, channel);
  }

  void addSwitch(const std::optional<pulse::Signal>& signal, pulse::EndReason reason, int direction,
                 std::size_t motor, Board& board, BoardPort::Channel& channel) {
    if (!signal) return;
    const Input& input = *inputs_.at(static_cast<std::size_t>(signal->line));
    if (input.board != &board) {
      refuse(input.name,
             fmt::format("stops a motor of the board {}: it must be on that board", board.name()));
    }
    if (!switches_.insert(signal->line).second) {
      refuse(input.name,
             "stops the motors of several axes: on a board each needs a line of its own");
    }
    channel.switches.push_back({endstopOf(signal->line), signal->active, reason, direction, motor});
  }

  [[noreturn]] static void refuse(const std::string& line, const std::string& why) {
    throw BoardError(fmt::format("Line {} {}.", line, why));
  }

  std::uint32_t endstopOf(int index) { return inputs_.at(static_cast<std::size_t>(index))->oid; }

  // ---- the thread of the port ----

  void sendWrites() {
    while (const Write* write = writes_.front()) {
      const Output& output = outputs_[static_cast<std::size_t>(write->line.output)];
      // What was written to a board before it failed isn't made up for.
      if (output.board->failure() == 0 && output.board->resumed() == write->resumed) {
        output.board->setOutput(*output.oid, write->line.level);
      }
      writes_.pop();
    }
    const Nanoseconds now = backend_.clock_.now();
    if (now < inputs_due_) return;
    inputs_due_ = now + kInputPeriod;
    for (const auto& input : inputs_) {
      if (input->board == nullptr || input->board->failure() != 0) continue;
      input->board->send(Command::kEndstopQueryState, {input->oid});
    }
  }

  void hear(const Board& board, const Heard& heard, Nanoseconds now) {
    if (heard.answer != Answer::kEndstopState) return;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      Input& input = *inputs_[i];
      if (input.board != &board || input.oid != heard.arguments[0]) continue;
      const int level = heard.arguments[3] != 0 ? 1 : 0;
      if (input.level.exchange(level) == level || !input.edges) return;
      edges_.add({static_cast<int>(i), level != 0, now});
      if (base_) base_->interrupt();
      return;
    }
  }

  friend class BoardBackend;

  BoardBackend& backend_;
  std::vector<std::unique_ptr<Board>> boards_;
  std::vector<Output> outputs_;
  std::vector<std::unique_ptr<Input>> inputs_;
  std::vector<int> base_inputs_;
  std::set<int> switches_;  // inputs that stop motors
  std::unique_ptr<gpio::Lines> base_;
  gpio::EdgeQueue edges_;
  std::mutex writers_;
  pulse::Mailbox<Write, kMostWrites> writes_;
  std::mutex restoring_;
  BoardPort* port_ = nullptr;  // outlived by this
  Nanoseconds inputs_due_ = 0;
};

BoardBackend::BoardBackend(gpio::Backend& base, pulse::Clock& clock,
                           std::vector<BoardSettings> boards, MakeLink link)
    : base_(base), clock_(clock), settings_(std::move(boards)), make_link_(std::move(link)) {}

BoardBackend::~BoardBackend() = default;

std::unique_ptr<gpio::Lines> BoardBackend::request(const std::vector<gpio::OutputRequest>& outputs,
                                                   const std::vector<gpio::InputRequest>& inputs) {
  std::vector<std::unique_ptr<Board>> boards;
  for (const BoardSettings& settings : settings_) {
    boards.push_back(std::make_unique<Board>(
        settings.name, [this, &settings] { return make_link_(settings); }, clock_,
        Board::Options{settings.resets_foreign}));
    boards.back()->identify();
  }
  auto lines = std::make_unique<HeldLines>(*this, std::move(boards));
  lines->hold(outputs, inputs);
  held_ = lines.get();
  return lines;
}

std::unique_ptr<pulse::StepPort> BoardBackend::makePort(
    gpio::Lines& /*lines*/, pulse::Clock& /*clock*/,
    const std::vector<pulse::ChannelConfig>& lanes) {
  for (const auto& input : held_->inputs_) {
    if (input->board != nullptr) input->oid = input->board->addEndstop(input->pin, input->pull_up);
  }
  return held_->makePort(lanes);
}

void BoardBackend::restore(gpio::Lines& /*lines*/) { held_->restore(); }

}  // namespace stepdriver::klipper
