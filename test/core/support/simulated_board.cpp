#include <chrono>
#include <map>
#include <mutex>
#include <utility>

#include "stepdriver_core/gpio/simulated_lines.h"
#include "support/line_names.h"
#include "support/test_board.h"

namespace stepdriver::test {
namespace {

class SimulatedTestBoard : public TestBoard, private gpio::Board {
 public:
  gpio::Backend& backend() override { return backend_; }

  std::string line(int chip, unsigned offset) const override {
    return "chip" + std::to_string(chip) + ":" + std::to_string(offset);
  }

  bool level(const std::string& line) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return levels_[line];
  }

  void drive(const std::string& line, bool level) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (std::exchange(levels_[line], level) == level) return;
    const auto listener = listeners_.find(line);
    if (listener != listeners_.end()) listener->second(level, now());
  }

  std::int64_t pace() const override { return 1'000'000; }

  std::int64_t now() const override {
    return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
  }

  std::optional<std::vector<Driven>> takeDriven() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(driven_, {});
  }

 private:
  int lineIndex(const std::string& line) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return names_.indexOf(line);
  }

  void onRequest(int line, bool level, std::int64_t time_ns) override {
    onEdge(line, level, time_ns);
  }

  void onEdge(int line, bool level, std::int64_t /*time_ns*/) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    levels_[names_[line]] = level;
    driven_.push_back({names_[line], level});
  }

  void onRelease(int /*line*/, std::int64_t /*time_ns*/) override {}

  bool inputLevel(int line, std::int64_t /*time_ns*/) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return levels_[names_[line]];
  }

  int writeFault(int /*line*/, std::int64_t /*time_ns*/) override { return 0; }

  void watchInput(int line, gpio::EdgeListener listener) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    listeners_.erase(names_[line]);
    if (listener) listeners_.emplace(names_[line], std::move(listener));
  }

  std::mutex mutex_;
  LineNames names_;
  std::map<std::string, bool> levels_;
  std::map<std::string, gpio::EdgeListener> listeners_;
  std::vector<Driven> driven_;
  gpio::SimulatedBackend backend_{*this, [this] { return now(); }};
};

}  // namespace

TestBoardKind simulatedBoard() {
  return {"Simulated", [] { return std::string(); },
          []() -> std::unique_ptr<TestBoard> { return std::make_unique<SimulatedTestBoard>(); }};
}

}  // namespace stepdriver::test
