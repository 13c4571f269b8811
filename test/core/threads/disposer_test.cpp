#include "machine/disposer.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <thread>
#include <vector>

namespace stepdriver::machine {
namespace {

/// Records the thread in which it was freed.
class Plan {
 public:
  explicit Plan(std::promise<std::thread::id>& freed) : freed_(freed) {}
  ~Plan() { freed_.set_value(std::this_thread::get_id()); }
  Plan(const Plan&) = delete;
  Plan& operator=(const Plan&) = delete;

 private:
  std::promise<std::thread::id>& freed_;
};

std::shared_ptr<const Plan> planIn(Disposer& disposer, std::promise<std::thread::id>& freed) {
  return disposer.keep(std::shared_ptr<const Plan>(std::make_shared<const Plan>(freed)));
}

constexpr std::chrono::seconds kLongest(30);

TEST(Disposer, FreesInAThreadOfItsOwn) {
  Disposer disposer(true);
  std::promise<std::thread::id> freed;
  std::future<std::thread::id> where = freed.get_future();
  auto plan = planIn(disposer, freed);
  auto second_user = plan;
  plan.reset();
  EXPECT_EQ(where.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  second_user.reset();
  ASSERT_EQ(where.wait_for(kLongest), std::future_status::ready);
  EXPECT_NE(where.get(), std::this_thread::get_id());
}

TEST(Disposer, FreesAtOnceWithoutThreads) {
  Disposer disposer(false);
  std::promise<std::thread::id> freed;
  std::future<std::thread::id> where = freed.get_future();
  planIn(disposer, freed).reset();
  ASSERT_EQ(where.wait_for(std::chrono::seconds(0)), std::future_status::ready);
  EXPECT_EQ(where.get(), std::this_thread::get_id());
}

TEST(Disposer, LeavesWhatIsInUseToItsLastUser) {
  std::promise<std::thread::id> freed;
  std::future<std::thread::id> where = freed.get_future();
  std::shared_ptr<const Plan> plan;
  {
    Disposer disposer(true);
    plan = planIn(disposer, freed);
  }
  EXPECT_EQ(where.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  plan.reset();
  EXPECT_EQ(where.wait_for(std::chrono::seconds(0)), std::future_status::ready);
}

struct Counted {
  explicit Counted(std::atomic<int>& all) : count(all) { ++count; }
  ~Counted() { --count; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
  std::atomic<int>& count;
};

TEST(Disposer, FreesAllThatSeveralThreadsHandOver) {
  std::atomic<int> count{0};
  {
    Disposer disposer(true);
    std::vector<std::thread> users(4);
    for (std::thread& user : users) {
      user = std::thread([&] {
        for (int k = 0; k < 2000; ++k) {
          disposer.keep(std::shared_ptr<const Counted>(std::make_shared<const Counted>(count)));
        }
      });
    }
    for (std::thread& user : users) user.join();
  }
  EXPECT_EQ(count, 0);
}

}  // namespace
}  // namespace stepdriver::machine
