#include "jog_sequence.h"

#include <gtest/gtest.h>

#include <optional>

namespace stepdriver::joystick {
namespace {

constexpr std::optional<double> kNoVelocity;
constexpr std::optional<bool> kNoCall;

void expectOrders(const JogOrders& orders, std::optional<double> velocity,
                  std::optional<bool> enable) {
  EXPECT_EQ(orders.velocity, velocity);
  EXPECT_EQ(orders.enable, enable);
}

/// A sequence that jogs at 0.1, and was enabled for that at 0.1 s.
JogSequence jogging(double disable_after) {
  JogSequence sequence = JogSequence::disabling(disable_after);
  sequence.orders(0.1, 0.0);
  sequence.answered(true, 0.1);
  return sequence;
}

TEST(JogSequence, RepeatsTheVelocityAndGivesNothingOnceWhenItIsOver) {
  JogSequence sequence;
  expectOrders(sequence.orders(0.0, 0.0), kNoVelocity, kNoCall);
  expectOrders(sequence.orders(0.1, 0.1), 0.1, kNoCall);
  expectOrders(sequence.orders(0.1, 0.2), 0.1, kNoCall);
  expectOrders(sequence.orders(-0.1, 0.3), -0.1, kNoCall);
  expectOrders(sequence.orders(0.0, 0.4), 0.0, kNoCall);
  expectOrders(sequence.orders(0.0, 0.5), kNoVelocity, kNoCall);
  expectOrders(sequence.orders(0.0, 1e6), kNoVelocity, kNoCall);
}

TEST(JogSequence, ChangesNothingOfAnAxisThatIsNotJogged) {
  JogSequence sequence = JogSequence::disabling(1.0);
  expectOrders(sequence.orders(0.0, 0.0), kNoVelocity, kNoCall);
  expectOrders(sequence.orders(0.0, 100.0), kNoVelocity, kNoCall);
}

TEST(JogSequence, EnablesBeforeItJogsAndDisablesInTheDeadBand) {
  JogSequence sequence = JogSequence::disabling(1.0);
  expectOrders(sequence.orders(0.1, 0.0), kNoVelocity, true);
  expectOrders(sequence.orders(0.1, 0.1), kNoVelocity, kNoCall);
  sequence.answered(true, 0.2);
  expectOrders(sequence.orders(0.1, 0.2), 0.1, kNoCall);
  expectOrders(sequence.orders(0.0, 5.0), 0.0, kNoCall);
  expectOrders(sequence.orders(0.0, 5.5), kNoVelocity, kNoCall);
  expectOrders(sequence.orders(0.1, 5.9), 0.1, kNoCall);
  expectOrders(sequence.orders(0.0, 6.0), 0.0, kNoCall);
  expectOrders(sequence.orders(0.0, 6.8), kNoVelocity, kNoCall);
  expectOrders(sequence.orders(0.0, 7.0), kNoVelocity, false);
  expectOrders(sequence.orders(0.0, 9.0), kNoVelocity, kNoCall);
  sequence.answered(true, 9.0);
  expectOrders(sequence.orders(0.0, 20.0), kNoVelocity, kNoCall);
  expectOrders(sequence.orders(0.1, 21.0), kNoVelocity, true);
}

TEST(JogSequence, DisablesAtOnceWhereItIsToldTo) {
  JogSequence sequence = jogging(0.0);
  sequence.orders(0.1, 0.2);
  expectOrders(sequence.orders(0.0, 0.3), 0.0, false);
}

TEST(JogSequence, WaitsForTheDisableBeforeItEnablesAgain) {
  JogSequence sequence = jogging(0.0);
  sequence.orders(0.0, 0.2);  // the order to disable
  expectOrders(sequence.orders(0.1, 0.3), kNoVelocity, kNoCall);
  sequence.answered(true, 0.4);
  expectOrders(sequence.orders(0.1, 0.4), kNoVelocity, true);
}

TEST(JogSequence, DisablesAnAxisThatWasEnabledTooLate) {
  JogSequence sequence = JogSequence::disabling(1.0);
  sequence.orders(0.1, 0.0);
  expectOrders(sequence.orders(0.0, 0.1), kNoVelocity, kNoCall);
  sequence.answered(true, 2.0);
  expectOrders(sequence.orders(0.0, 2.5), kNoVelocity, kNoCall);
  expectOrders(sequence.orders(0.0, 3.0), kNoVelocity, false);
}

TEST(JogSequence, TriesAgainAfterAWhileWhatWasRefused) {
  JogSequence sequence = JogSequence::disabling(0.0);
  sequence.orders(0.1, 0.0);
  sequence.answered(false, 0.1);
  expectOrders(sequence.orders(0.1, 0.5), kNoVelocity, kNoCall);
  expectOrders(sequence.orders(0.1, 1.2), kNoVelocity, true);
  sequence.answered(true, 1.3);
  expectOrders(sequence.orders(0.0, 1.4), kNoVelocity, false);
  sequence.answered(false, 1.5);
  expectOrders(sequence.orders(0.0, 2.0), kNoVelocity, kNoCall);
  expectOrders(sequence.orders(0.0, 2.6), kNoVelocity, false);
}

}  // namespace
}  // namespace stepdriver::joystick
