#include "pwm_backend.h"

#include <pthread.h>
#include <semaphore.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "may_wait.h"
#include "pwm_channel.h"
#include "start_thread.h"

namespace stepdriver::gpio {
namespace {

constexpr std::size_t kMostBaseWrites = 256;  // at one instant

/// The channels of a chip, and the thread that writes them.
class PwmChip {
 public:
  PwmChip() {
    sem_init(&ordered_, 0, 0);
    try {
      thread_ = startThread([this] { run(); });
    } catch (...) {
      sem_destroy(&ordered_);
      throw;
    }
  }
  PwmChip(const PwmChip&) = delete;
  PwmChip& operator=(const PwmChip&) = delete;
  ~PwmChip() {
    ending_ = true;
    sem_post(&ordered_);
    thread_.join();
    sem_destroy(&ordered_);
  }

  /// Before the first write.
  std::size_t add(const std::string& folder, const PwmLine& line, bool level) {
    const std::lock_guard<std::mutex> lock(mutex_);
    outputs_.emplace_back(folder, line, level);
    return outputs_.size() - 1;
  }

  int write(std::size_t number, bool level, std::uint16_t part = LineWrite::kWhole) noexcept {
    Output& output = outputs_[number];
    const std::uint64_t order = output.last_order.fetch_add(1) + 1;
    if (!this_thread_may_wait) output.late = order;
    // Of two threads that write at once, the one that ordered later counts.
    const std::uint64_t wanted =
        order << kSettingBits | (this_thread_may_wait ? 0U : kLate) | (level ? kHigh | part : 0U);
    std::uint64_t before = output.wanted.load();
    while (before < wanted && !output.wanted.compare_exchange_weak(before, wanted)) {
    }
    sem_post(&ordered_);
    if (!this_thread_may_wait) return 0;
    std::unique_lock<std::mutex> lock(mutex_);
    made_.wait(lock, [&] { return output.made >= order; });
    return output.error;
  }

  LateWrites lateWrites(std::size_t number) const noexcept {
    const Output& output = outputs_[number];
    LateWrites writes{output.late, output.made};
    // In this order, each that has ended is also known to have failed.
    writes.failed = output.failed;
    writes.error = output.late_error;
    return writes;
  }

 private:
  // What is ordered: the part, whether it is high, and whether nobody waits for it.
  static constexpr std::uint64_t kHigh = 1U << 16U;
  static constexpr std::uint64_t kLate = 1U << 17U;
  static constexpr unsigned kSettingBits = 18;

  struct Output {
    Output(const std::string& folder, const PwmLine& line, bool level)
        : channel(folder, line, level) {}

    const PwmChannel channel;
    std::atomic<std::uint64_t> last_order{0};
    std::atomic<std::uint64_t> wanted{0};  // the number of an order, and behind it what it is
    std::atomic<std::uint64_t> made{0};    // that order is written, or a later one
    std::atomic<std::uint64_t> late{0};    // the last order for which nobody waits
    std::atomic<std::uint64_t> failed{0};  // the last of those that has failed
    std::atomic<int> late_error{0};        // errno of that one
    int error = 0;                         // errno of the last write; 0: it succeeded
  };

  void run() {
    pthread_setname_np(pthread_self(), "pwm writer");
    while (!ending_) {
      if (sem_wait(&ordered_) != 0) continue;  // a signal
      std::unique_lock<std::mutex> lock(mutex_);
      for (Output& output : outputs_) {
        const std::uint64_t wanted = output.wanted.load();
        const std::uint64_t order = wanted >> kSettingBits;
        if (order == output.made) continue;
        lock.unlock();
        const int error =
            output.channel.write((wanted & kHigh) != 0, static_cast<std::uint16_t>(wanted));
        lock.lock();
        output.error = error;
        if (error != 0 && (wanted & kLate) != 0) {
          output.late_error = error;
          output.failed = order;
        }
        output.made = order;
        made_.notify_all();
      }
    }
  }

  std::deque<Output> outputs_;
  std::atomic<bool> ending_{false};
  sem_t ordered_{};
  std::mutex mutex_;
  std::condition_variable made_;
  std::thread thread_;
};

class PwmLines final : public Lines {
 public:
  PwmLines(Backend& base, const std::string& folder, const std::vector<OutputRequest>& outputs,
           const std::vector<InputRequest>& inputs) {
    std::vector<OutputRequest> others;
    for (const OutputRequest& request : outputs) {
      Output& output = outputs_.emplace_back();
      output.pwm = pwmLineOf(request.line);
      output.safe_level = request.safe_level;
      output.keeps = request.keep_on_release;
      if (output.pwm) {
        output.name = output.pwm->name();
      } else {
        output.number = others.size();
        others.push_back(request);
      }
    }
    base_ = base.request(others, inputs);
    for (Output& output : outputs_) {
      if (!output.pwm) continue;
      std::unique_ptr<PwmChip>& chip = chips_[output.pwm->chip];
      if (chip == nullptr) chip = std::make_unique<PwmChip>();
      output.chip = chip.get();
      output.number = chip->add(folder, *output.pwm, output.safe_level);
    }
  }
  ~PwmLines() override {
    for (const Output& output : outputs_) {
      // Nobody is left who could be told.
      if (output.pwm && !output.keeps) (void)output.chip->write(output.number, output.safe_level);
    }
  }

  int write(const LineWrite* writes, std::size_t count) noexcept override {
    // Those of the base first, in one call: they are for one instant.
    std::array<LineWrite, kMostBaseWrites> others;
    std::size_t other_count = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const Output* const output = find(writes[i].output);
      if (output == nullptr || other_count == others.size()) return EINVAL;
      if (output->pwm) continue;
      others[other_count++] = {static_cast<int>(output->number), writes[i].level};
    }
    int error = other_count != 0 ? base_->write(others.data(), other_count) : 0;
    for (std::size_t i = 0; i < count; ++i) {
      const Output* const output = find(writes[i].output);
      if (!output->pwm) continue;
      const int own = output->chip->write(output->number, writes[i].level, writes[i].part);
      if (error == 0) error = own;
    }
    return error;
  }
  LateWrites lateWrites(int number) const noexcept override {
    const Output& output = outputs_[static_cast<std::size_t>(number)];
    return output.pwm ? output.chip->lateWrites(output.number)
                      : base_->lateWrites(static_cast<int>(output.number));
  }
  int read(int input) noexcept override { return base_->read(input); }
  int waitForEdges(std::int64_t timeout_ns, EdgeEvent* events,
                   std::size_t capacity) noexcept override {
    return base_->waitForEdges(timeout_ns, events, capacity);
  }
  void interrupt() noexcept override { base_->interrupt(); }
  const std::string& outputName(int output) const override {
    const Output& line = outputs_.at(static_cast<std::size_t>(output));
    return line.pwm ? line.name : base_->outputName(static_cast<int>(line.number));
  }
  const std::string& inputName(int input) const override { return base_->inputName(input); }
  std::string failureText(bool input, int line) const override {
    if (input) return base_->failureText(true, line);
    const Output& output = outputs_.at(static_cast<std::size_t>(line));
    return output.pwm ? "" : base_->failureText(false, static_cast<int>(output.number));
  }
  std::size_t outputChip(int output) const override {
    const Output& line = outputs_.at(static_cast<std::size_t>(output));
    if (!line.pwm) return base_->outputChip(static_cast<int>(line.number));
    // Behind the chips of the base and the boards.
    constexpr std::size_t kFirst = 10'000;
    return kFirst + static_cast<std::size_t>(line.pwm->chip);
  }

 private:
  struct Output {
    std::optional<PwmLine> pwm;  // empty: it is one of the base
    std::string name;
    bool safe_level = false;
    bool keeps = false;
    PwmChip* chip = nullptr;
    std::size_t number = 0;  // in its chip, or in the base
  };

  const Output* find(int output) const {
    const auto index = static_cast<std::size_t>(output);
    return output >= 0 && index < outputs_.size() ? &outputs_[index] : nullptr;
  }

  std::vector<Output> outputs_;
  std::unique_ptr<Lines> base_;
  std::map<int, std::unique_ptr<PwmChip>> chips_;
};

class PwmBackend final : public Backend {
 public:
  PwmBackend(std::unique_ptr<Backend> base, std::string folder)
      : base_(std::move(base)), folder_(std::move(folder)) {}

  std::unique_ptr<Lines> request(const std::vector<OutputRequest>& outputs,
                                 const std::vector<InputRequest>& inputs) override {
    for (const OutputRequest& output : outputs) {
      if (!pwmLineOf(output.line)) continue;
      return std::make_unique<PwmLines>(*base_, folder_, outputs, inputs);
    }
    return base_->request(outputs, inputs);
  }
  SerialExchange simulatedSerial(const std::string& port) override {
    return base_->simulatedSerial(port);
  }

 private:
  const std::unique_ptr<Backend> base_;
  const std::string folder_;
};

}  // namespace

std::unique_ptr<Backend> withPwm(std::unique_ptr<Backend> base, std::string folder) {
  return std::make_unique<PwmBackend>(std::move(base), std::move(folder));
}

}  // namespace stepdriver::gpio
