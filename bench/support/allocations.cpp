#include "support/allocations.h"

#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<std::int64_t> taken{0};
std::atomic<std::int64_t> taken_bytes{0};
std::atomic<std::int64_t> in_use{0};

void release(void* memory) {
  in_use.fetch_sub(static_cast<std::int64_t>(malloc_usable_size(memory)),
                   std::memory_order_relaxed);
  std::free(memory);
}

}  // namespace

// The array forms call these.
void* operator new(std::size_t size) {
  taken.fetch_add(1, std::memory_order_relaxed);
  taken_bytes.fetch_add(static_cast<std::int64_t>(size), std::memory_order_relaxed);
  if (void* memory = std::malloc(size == 0 ? 1 : size)) {
    in_use.fetch_add(static_cast<std::int64_t>(malloc_usable_size(memory)),
                     std::memory_order_relaxed);
    return memory;
  }
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { release(memory); }
void operator delete(void* memory, std::size_t /*size*/) noexcept { release(memory); }

namespace stepdriver::bench {

Allocations allocations() { return {taken.load(), taken_bytes.load()}; }

std::int64_t allocatedNow() { return in_use.load(); }

}  // namespace stepdriver::bench
