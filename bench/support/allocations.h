#pragma once

#include <cstdint>

namespace stepdriver::bench {

/// The memory that this program has allocated so far. A program that calls this counts every
/// operator new.
struct Allocations {
  std::int64_t count = 0;
  std::int64_t bytes = 0;
};

Allocations allocations();

/// [bytes] Memory in use.
std::int64_t allocatedNow();

inline Allocations operator-(const Allocations& a, const Allocations& b) {
  return {a.count - b.count, a.bytes - b.bytes};
}
inline bool operator==(const Allocations& a, const Allocations& b) {
  return a.count == b.count && a.bytes == b.bytes;
}

}  // namespace stepdriver::bench
