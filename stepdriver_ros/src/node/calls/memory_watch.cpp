#include "memory_watch.h"

#include <fcntl.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>

namespace stepdriver::ros_node {
namespace {

constexpr std::chrono::seconds kShortestPause{1};
constexpr std::chrono::seconds kLongestPause{64};
// [bytes] Pieces from this size on have memory of their own, which goes back to the system as soon
// as they are freed, and no thread keeps more than this for later. By default the C library raises
// both limits to the size of the largest piece that was ever freed, up to 32 MB and twice as much.
constexpr int kLargePiece = 128 << 10;

/// Not worth the effort.
bool isMuchMore(std::size_t pages, std::size_t than) { return pages > than + than / 32; }

}  // namespace

MemoryWatch::MemoryWatch()
    : statm_(open("/proc/self/statm", O_RDONLY | O_CLOEXEC)),
      least_(residentPages()),
      last_(least_),
      pause_(kShortestPause) {
  mallopt(M_MMAP_THRESHOLD, kLargePiece);
  mallopt(M_TRIM_THRESHOLD, kLargePiece);
}

void MemoryWatch::look() {
  const std::size_t pages = residentPages();
  const bool settled = !isMuchMore(pages, last_) && !isMuchMore(last_, pages);
  last_ = pages;
  least_ = std::min(least_, pages);
  const Clock::time_point now = Clock::now();
  if (!settled) {
    pause_ = kShortestPause;
    next_ = now;
  }
  if (!settled || !isMuchMore(pages, least_) || now < next_) return;
  malloc_trim(0);
  last_ = residentPages();
  // What is in use can't be given back.
  next_ = now + pause_;
  pause_ = std::min(2 * pause_, kLongestPause);
}

std::size_t MemoryWatch::residentPages() const {
  std::array<char, 128> text{};
  if (pread(statm_.number(), text.data(), text.size() - 1, 0) <= 0) return 0;
  std::size_t all = 0;
  std::size_t resident = 0;
  return std::sscanf(text.data(), "%zu %zu", &all, &resident) == 2 ? resident : 0;
}

}  // namespace stepdriver::ros_node
