#pragma once

#include <cstdint>
#include <limits>

namespace stepdriver::test {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr std::int64_t kMillisecond = 1'000'000;  // ns
inline constexpr std::int64_t kSecond = 1'000'000'000;   // ns

}  // namespace stepdriver::test
