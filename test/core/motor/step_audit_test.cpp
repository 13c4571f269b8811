#include "motor/step_audit.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

namespace stepdriver::motor {
namespace {

// MSCNT of a chip that has heard these steps in this mode, and counts forward (1) or backward.
int mscntAt(std::int64_t steps, int microsteps, int sign) {
  const std::int64_t counted = sign * steps * (256 / microsteps) % 1024;
  return static_cast<int>((counted + 1024) % 1024);
}

TEST(StepAudit, AgreesWithAChipThatHearsAllInEachModeAndDirection) {
  for (const int microsteps : {1, 2, 16, 128, 256}) {
    for (const int sign : {1, -1}) {
      StepAudit audit;
      audit.begin(mscntAt(5, microsteps, sign), 5);
      for (std::int64_t count = -2000; count < 2000; count += 7) {
        ASSERT_EQ(audit.check(mscntAt(count, microsteps, sign), count, microsteps), "")
            << microsteps << " " << sign << " " << count;
      }
      constexpr std::int64_t kFar = std::int64_t{1} << 40;
      EXPECT_EQ(audit.check(mscntAt(kFar + 3, microsteps, sign), kFar + 3, microsteps), "");
    }
  }
}

TEST(StepAudit, FindsEachDifferenceBelowHalfACycle) {
  for (const int microsteps : {4, 16, 256}) {
    for (const int sign : {1, -1}) {
      for (std::int64_t more = 1; more < 2 * microsteps; ++more) {
        StepAudit audit;
        audit.begin(0, 0);
        ASSERT_EQ(audit.check(mscntAt(3, microsteps, sign), 3, microsteps), "");
        const std::string steps = std::to_string(more) + (more == 1 ? " step " : " steps ");
        EXPECT_EQ(audit.check(mscntAt(40 + more, microsteps, sign), 40, microsteps),
                  "is " + steps + "ahead of the pulses that were sent");
        // From here on it begins again.
        EXPECT_EQ(audit.check(mscntAt(40 + more, microsteps, sign), 40, microsteps), "");
        EXPECT_EQ(audit.check(mscntAt(40, microsteps, sign), 40, microsteps),
                  "is " + steps + "behind the pulses that were sent");
      }
    }
  }
}

TEST(StepAudit, FindsALossBeforeItKnowsTheDirection) {
  StepAudit audit;
  audit.begin(0, 0);
  EXPECT_EQ(audit.check(mscntAt(9, 16, 1), 10, 16),
            "is 1 step away from the pulses that were sent");
}

TEST(StepAudit, ComparesNothingAfterItsEnd) {
  StepAudit audit;
  audit.begin(0, 0);
  audit.end();
  EXPECT_EQ(audit.check(77, 10, 16), "");
  EXPECT_EQ(audit.check(77, 10, 16), "");
  EXPECT_NE(audit.check(78, 10, 16), "");
}

}  // namespace
}  // namespace stepdriver::motor
