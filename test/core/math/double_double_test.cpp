#include "math/double_double.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/random_motion.h"

namespace stepdriver::motion {
namespace {

constexpr double kExact = 0x1p-100;  // relative

DoubleDouble anyNumber(Random& random) {
  const double hi = random.decades(-12.0, 18.0) * (random.chance(0.5) ? 1.0 : -1.0);
  return normalized(hi, hi * 0x1p-53 * random.within(-1.0, 1.0));
}

void expectSame(DoubleDouble a, DoubleDouble b, double scale) {
  EXPECT_LE(std::abs((a - b).hi), kExact * std::abs(scale)) << a.hi << " and " << b.hi;
}

TEST(DoubleDouble, QuotientsAndRootsHaveHundredBits) {
  Random random(1);
  for (int i = 0; i < 100000; ++i) {
    const DoubleDouble a = anyNumber(random);
    const DoubleDouble b = anyNumber(random);
    expectSame(a / b * b, a, a.hi);
    expectSame(a / b.hi * b.hi, a, a.hi);
    const DoubleDouble root = sqrt(abs(a));
    expectSame(root * root, abs(a), a.hi);
    if (HasFailure()) return;
  }
}

TEST(DoubleDouble, TakesADoubleLikeAnyOther) {
  Random random(2);
  for (int i = 0; i < 100000; ++i) {
    const DoubleDouble a = anyNumber(random);
    const double b = anyNumber(random).hi;
    expectSame(a + b, a + DoubleDouble(b), std::abs(a.hi) + std::abs(b));
    expectSame(a - b, a - DoubleDouble(b), std::abs(a.hi) + std::abs(b));
    expectSame(a * b, a * DoubleDouble(b), a.hi * b);
    expectSame(a / b, a / DoubleDouble(b), a.hi / b);
    expectSame(half(a), a * DoubleDouble(0.5), a.hi);
    if (HasFailure()) return;
  }
}

}  // namespace
}  // namespace stepdriver::motion
