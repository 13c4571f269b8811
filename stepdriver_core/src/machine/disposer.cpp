#include "machine/disposer.h"

#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <mutex>
#include <thread>

#include "start_thread.h"

namespace stepdriver::machine {
namespace {

constexpr int kNiceness = 10;

// Regardless of the thread that created this one.
void lowerPriority() {
  const sched_param none{};
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &none);
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), kNiceness);
  pthread_setname_np(pthread_self(), "disposer");
}

}  // namespace

// Outlives the disposer as long as one of its objects is in use.
class Disposer::Queue {
 public:
  struct Entry {
    std::shared_ptr<const void> object;
    Entry* next = nullptr;
  };

  explicit Queue(bool threaded) : open_(threaded) { sem_init(&come_, 0, 0); }
  ~Queue() {
    freeAll();
    sem_destroy(&come_);
  }
  Queue(const Queue&) = delete;
  Queue& operator=(const Queue&) = delete;

  /// The first call starts the thread.
  void start() {
    if (!open_.load(std::memory_order_acquire)) return;
    std::call_once(started_, [this] { thread_ = startThread([this] { run(); }); });
  }

  void add(Entry* entry) {
    if (!open_.load(std::memory_order_acquire)) {
      delete entry;
      return;
    }
    entry->next = last_.load(std::memory_order_relaxed);
    while (!last_.compare_exchange_weak(entry->next, entry, std::memory_order_release,
                                        std::memory_order_relaxed)) {
    }
    sem_post(&come_);
  }

  void close() {
    open_.store(false, std::memory_order_release);
    sem_post(&come_);
    if (thread_.joinable()) thread_.join();
    freeAll();
  }

 private:
  void run() {
    lowerPriority();
    while (open_.load(std::memory_order_acquire)) {
      freeAll();
      while (sem_wait(&come_) != 0) {
      }
    }
  }

  void freeAll() {
    Entry* entry = last_.exchange(nullptr, std::memory_order_acquire);
    while (entry != nullptr) {
      Entry* next = entry->next;
      delete entry;
      entry = next;
    }
  }

  std::atomic<bool> open_;
  std::atomic<Entry*> last_{nullptr};
  sem_t come_;
  std::once_flag started_;
  std::thread thread_;
};

Disposer::Disposer(bool threaded) : queue_(std::make_shared<Queue>(threaded)) {}

Disposer::~Disposer() { queue_->close(); }

std::shared_ptr<const void> Disposer::keepAny(std::shared_ptr<const void> owned) {
  queue_->start();
  const void* object = owned.get();
  auto* entry = new Queue::Entry{std::move(owned)};
  return {object, [queue = queue_, entry](const void* /*object*/) { queue->add(entry); }};
}

}  // namespace stepdriver::machine
