#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "support/probe_bench.h"
#include "support/refusal.h"

// Probings whose axis meets an endstop, or its limits: 80 steps/mm, 20 mm/s, the contact is at 20
// mm. At 1 m/s^2 the axis comes to rest 0.2 mm after it.

namespace stepdriver {
namespace {

using machine::ProbeEnd;
using machine::ProbeRequest;
using machine::ProbeResult;
using test::kStep;
using test::ProbeBench;
using test::ProbeWay;

/// It must stand where its last pulse went, and stay there.
void expectAtRest(ProbeBench& bench, const ProbeResult& result) {
  EXPECT_FALSE(bench->axis().state().moving);
  EXPECT_EQ(test::violationsOf(bench->report()), "");
  const std::int64_t pulses = bench->pulses();
  bench->machine->advance(0.5);
  EXPECT_EQ(bench->pulses(), pulses);
  EXPECT_NEAR(result.positions.at(0), bench.jointAt("x", bench->clock.now()) * kStep, 1e-9);
}

TEST(ProbeAtEndstops, WithoutAContactBeforeItFailsAndNamesTheEndstop) {
  for (const ProbeWay& way : test::probeWays()) {
    SCOPED_TRACE(way.text());
    for (const double before : {15.0, 19.9, 20.0 - 1.0 / 80.0}) {
      SCOPED_TRACE(before);
      ProbeBench bench(way, {20.0, before});
      ProbeRequest request = bench.over(0.05);
      request.must = false;
      const ProbeResult result = bench->machine->probe(request);
      EXPECT_EQ(result.end, ProbeEnd::kFailed);
      EXPECT_FALSE(result.succeeded) << "it didn't come to its end";
      EXPECT_TRUE(result.contact.empty());
      EXPECT_NE(result.message.find(way.towards_max ? "the max endstop was met"
                                                    : "the min endstop was met"),
                std::string::npos)
          << result.message;
      EXPECT_NEAR(bench.reached(), before / 1e3, 1e-9);
      expectAtRest(bench, result);
      EXPECT_REFUSED(bench->machine->probe(request),
                     way.towards_max ? "it moves only towards min" : "it moves only towards max");
    }
  }
}

// The contact's place is known, but the axes stand at the endstop: no second touch, no way back.
TEST(ProbeAtEndstops, MetAtTheContactOrWhileItComesToRestFailsWithThePlace) {
  for (const ProbeWay& way : test::probeWays()) {
    SCOPED_TRACE(way.text());
    // Away, the input is inactive from the step after 20 mm on.
    for (const double after : {way.away ? 1.0 / 80.0 : 0.0, 2.0 / 80.0, 0.1, 0.15}) {
      SCOPED_TRACE(after);
      ProbeBench bench(way, {20.0, 20.0 + after});
      ProbeRequest request = bench.over(0.05);
      request.second_velocity = 0.002;
      request.back_off = 0.003;
      request.returns = true;
      const ProbeResult result = bench->machine->probe(request);
      EXPECT_EQ(result.end, ProbeEnd::kFailed);
      EXPECT_EQ(result.message.rfind("after the contact: ", 0), 0U) << result.message;
      EXPECT_NE(result.message.find("endstop was met"), std::string::npos) << result.message;
      ASSERT_EQ(bench.contacts().size(), 1U);
      ASSERT_EQ(result.contact.size(), request.names.size());
      for (std::size_t i = 0; i < request.names.size(); ++i) {
        EXPECT_NEAR(result.contact[i] / kStep,
                    bench.jointAt(request.names[i], bench.contacts().front()), 0.5 + 1e-6)
            << request.names[i];
      }
      EXPECT_NEAR(bench.reached(), (20.0 + after) / 1e3, 1e-9);
      expectAtRest(bench, result);
    }
  }
}

TEST(ProbeAtEndstops, RightBehindTheDecelerationIsNotMet) {
  for (const ProbeWay& way : test::probeWays()) {
    SCOPED_TRACE(way.text());
    ProbeBench bench(way, {20.0, 20.3});
    ProbeRequest request = bench.over(0.05);
    request.second_velocity = 0.002;
    request.back_off = 0.003;
    request.returns = true;
    const ProbeResult result = bench->machine->probe(request);
    EXPECT_EQ(result.end, ProbeEnd::kContact) << result.message;
    EXPECT_LT(bench.reached(), 0.0203);
    EXPECT_EQ(test::violationsOf(bench->report()), "");
  }
}

// ---- the limits of the axis ----

ProbeRequest inTwoTouches(const ProbeBench& bench, double back_off) {
  ProbeRequest request = bench.over(0.05);
  request.second_velocity = 0.002;
  request.back_off = back_off;
  return request;
}

TEST(ProbeWithinLimits, BacksOffToItsBeginningAtTheFarthest) {
  for (const ProbeWay& way : test::probeWays()) {
    SCOPED_TRACE(way.text());
    for (const double back_off : {0.019, 0.03, 1e3}) {
      SCOPED_TRACE(back_off);
      ProbeBench bench(way, {20.0});
      double nearest = 1.0;
      bool has_touched = false;
      const ProbeResult result = bench->machine->probe(inTwoTouches(bench, back_off), [&] {
        has_touched = has_touched || bench.reached() > 0.02;
        const double place = way.sign() * bench->axis().state().position;
        if (has_touched) nearest = std::min(nearest, place);
        return false;
      });
      EXPECT_EQ(result.end, ProbeEnd::kContact) << result.message;
      ASSERT_EQ(bench.contacts().size(), 2U);
      EXPECT_NEAR(result.contact[0] / kStep, bench.jointAt("x", bench.contacts().back()),
                  0.5 + 1e-6);
      if (!way.with_y) {
        const double first = way.sign() * bench.jointAt("x", bench.contacts().front()) * kStep;
        EXPECT_NEAR(nearest, std::max(0.0, first - back_off), 1.01 * kStep);
      }
      EXPECT_GT(nearest, -0.51 * kStep);
    }
  }
}

TEST(ProbeWithinLimits, IsRefusedIfItsTargetIsBeyondThem) {
  for (const bool towards_max : {true, false}) {
    ProbeBench::Rig rig;
    rig.limit_ahead = 0.03;
    ProbeBench bench({towards_max}, rig);
    EXPECT_REFUSED(bench->machine->probe(bench.over(0.0301)), "soft limit");
    EXPECT_EQ(bench->pulses(), 0);
  }
}

// Both its beginning and its target are at a limit.
TEST(ProbeWithinLimits, FindsAContactRightAtALimitAndStaysWithinThem) {
  for (const ProbeWay& way : test::probeWays()) {
    SCOPED_TRACE(way.text());
    // The edge from active to inactive comes with the step after 29.9875 mm.
    for (const double contact : {0.05, 29.9, way.away ? 29.9875 : 30.0}) {
      SCOPED_TRACE(contact);
      const double slack = way.towards_max ? way.backlash : 0.0;
      ProbeBench::Rig rig;
      rig.contact = contact + 1e3 * slack;  // the rig's carriage is ahead of the joint by that
      rig.limit_behind = 0.0;
      rig.limit_ahead = 0.03;
      ProbeBench bench(way, rig);
      ProbeRequest request = inTwoTouches(bench, 0.003);
      request.positions = bench.over(0.03).positions;
      request.returns = true;
      double least = 0.0;
      double most = 0.0;
      const ProbeResult result = bench->machine->probe(request, [&] {
        const double place = way.sign() * bench->axis().state().position;
        least = std::min(least, place);
        most = std::max(most, place);
        return false;
      });
      EXPECT_EQ(result.end, ProbeEnd::kContact) << result.message;
      ASSERT_EQ(bench.contacts().size(), 2U);
      EXPECT_NEAR(result.contact.at(0) / kStep, bench.jointAt("x", bench.contacts().back()),
                  0.5 + 1e-6);
      EXPECT_GT(least, -0.51 * kStep);
      EXPECT_LT(most, 0.03 + 0.51 * kStep);
      EXPECT_NEAR(result.positions.at(0), result.contact.at(0), 0.51 * kStep);
    }
  }
}

}  // namespace
}  // namespace stepdriver
