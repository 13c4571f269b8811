#include <sys/types.h>

#include <atomic>
#include <cfloat>
#include <cstddef>
#include <cstdint>
#include <limits>

// What the pulse thread and the times of its steps need of a processor and its compiler. On one
// that lacks it, the build fails here.

namespace stepdriver::pulse {
namespace {

template <typename... Types>
constexpr bool kLockFree = (std::atomic<Types>::is_always_lock_free && ...);

// Otherwise the pulse thread would wait for a lock in libatomic, whose owner may have no priority.
static_assert(kLockFree<bool, int, pid_t, std::size_t, std::uint32_t, std::uint64_t, std::int64_t>,
              "atomics of 64 bits take a lock on this processor; for a 32-bit Raspberry Pi 1 or "
              "Zero, compile with -march=armv6k+fp");

// The sums and products of motion/double_double.h must be rounded like doubles, and only once.
static_assert(std::numeric_limits<double>::is_iec559 && std::numeric_limits<double>::digits == 53,
              "a double must have 53 bits");
static_assert(FLT_EVAL_METHOD == 0,
              "doubles are computed with more than 53 bits; on a 32-bit PC, compile with "
              "-msse2 -mfpmath=sse");

}  // namespace
}  // namespace stepdriver::pulse
