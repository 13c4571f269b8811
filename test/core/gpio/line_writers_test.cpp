#include "gpio/line_writers.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace stepdriver::gpio {
namespace {

constexpr std::int64_t kTimeoutNs = 1'000'000;
constexpr LineWrite kOn{0, true};
constexpr LineWrite kOff{0, false};

/// Outputs whose writes hang while the gate is closed. Remembers the levels of each.
class HangingLines : public Lines {
 public:
  int write(const LineWrite* writes, std::size_t count) noexcept override {
    std::unique_lock<std::mutex> lock(mutex_);
    ++begun_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return open_; });
    for (std::size_t i = 0; i < count; ++i) levels_[writes[i].output].push_back(writes[i].level);
    return 0;
  }
  int read(int /*input*/) noexcept override { return -ENODEV; }
  int waitForEdges(std::int64_t /*timeout_ns*/, EdgeEvent* /*events*/,
                   std::size_t /*capacity*/) noexcept override {
    return -ENODEV;
  }
  void interrupt() noexcept override {}
  const std::string& outputName(int /*output*/) const override { return name_; }
  const std::string& inputName(int /*input*/) const override { return name_; }

  void setOpen(bool open) {
    const std::lock_guard<std::mutex> lock(mutex_);
    open_ = open;
    changed_.notify_all();
  }
  /// Waits until as many writes have begun.
  void awaitBegun(int writes) {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this, writes] { return begun_ >= writes; });
  }
  std::vector<bool> levels(int output) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return levels_[output];
  }

 private:
  const std::string name_ = "a line";
  std::mutex mutex_;
  std::condition_variable changed_;
  bool open_ = true;
  int begun_ = 0;
  std::map<int, std::vector<bool>> levels_;
};

/// Two outputs of one chip: the safe level of the first is low, that of the second is high.
class LineWritersTest : public testing::Test {
 protected:
  ~LineWritersTest() override { lines_->setOpen(true); }

  /// Waits until the write has ended. @return errno.
  int await(std::uint64_t id) {
    for (;; std::this_thread::yield()) {
      for (const LineWriters::Done& done : writers_.collect()) errors_[done.id] = done.error;
      if (const auto ended = errors_.find(id); ended != errors_.end()) return ended->second;
    }
  }
  /// A write that hangs at its line until its time is over. A thread that begins late would find
  /// that the time is over, and not make it.
  void timeOut(std::uint64_t id, const LineWrite& write) {
    lines_->setOpen(false);
    writers_.write(id, write);
    lines_->awaitBegun(1);
    EXPECT_EQ(await(id), ETIMEDOUT);
  }
  /// All earlier writes have been made when this one has been.
  void flush() {
    lines_->setOpen(true);
    // Its own time may be over before those that hung have returned.
    do writers_.write(++flushes_, {1, true});
    while (await(flushes_) != 0);
  }

  std::shared_ptr<HangingLines> lines_ = std::make_shared<HangingLines>();
  LineWriters writers_{lines_, {false, true}, true, kTimeoutNs, [] {}};
  std::map<std::uint64_t, int> errors_;
  std::uint64_t flushes_ = 100;
};

TEST_F(LineWritersTest, MakeTheLineSafeAfterAWriteThatTimedOut) {
  timeOut(1, kOn);
  flush();
  EXPECT_EQ(lines_->levels(0), (std::vector<bool>{true, false}));
}

TEST_F(LineWritersTest, MakeTheLineSafeIfTheSafeWriteTimedOutBehindAnother) {
  timeOut(1, kOn);
  writers_.write(2, kOff);
  EXPECT_EQ(await(2), ETIMEDOUT);
  flush();
  EXPECT_EQ(lines_->levels(0), (std::vector<bool>{true, false}));
}

TEST_F(LineWritersTest, DoNotMakeAWriteThatTimedOutBehindAnother) {
  timeOut(1, {1, false});
  writers_.write(2, kOn);
  EXPECT_EQ(await(2), ETIMEDOUT);
  flush();
  EXPECT_EQ(lines_->levels(0), std::vector<bool>{false});
  ASSERT_GE(lines_->levels(1).size(), 2U);
  EXPECT_FALSE(lines_->levels(1)[0]);
  EXPECT_TRUE(lines_->levels(1)[1]);
}

TEST_F(LineWritersTest, LeaveTheLineToALaterWrite) {
  timeOut(1, kOn);
  writers_.write(2, kOn);  // only collect() ends its time
  lines_->setOpen(true);
  while (!writers_.idle()) std::this_thread::yield();
  EXPECT_EQ(await(2), 0);
  flush();
  EXPECT_EQ(lines_->levels(0), (std::vector<bool>{true, true}));
}

}  // namespace
}  // namespace stepdriver::gpio
