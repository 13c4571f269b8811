#include "memory_reserve.h"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <new>

namespace stepdriver::ros_node {
namespace {

constexpr std::size_t kReserve = std::size_t{4} << 20;

std::atomic<void*> reserve{nullptr};
std::atomic<bool> used{false};

// Called by operator new in any thread. It returns if another attempt may succeed.
void releaseReserve() {
  void* memory = reserve.exchange(nullptr);
  if (memory == nullptr) throw std::bad_alloc();
  std::free(memory);
  used = true;
  kill(getpid(), SIGTERM);
}

}  // namespace

MemoryReserve::MemoryReserve() {
  void* memory = std::malloc(kReserve);
  if (memory == nullptr) throw std::bad_alloc();
  std::memset(memory, 1, kReserve);  // now it isn't only promised
  reserve = memory;
  std::set_new_handler(releaseReserve);
}

bool MemoryReserve::isUsed() { return used; }

}  // namespace stepdriver::ros_node
