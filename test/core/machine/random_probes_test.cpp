#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "support/probe_bench.h"

// Probings at random speeds to contacts at random places: towards a contact and away from it, in
// both directions, with a backlash, along one axis and two. 80 steps/mm.

namespace stepdriver {
namespace {

using machine::ProbeEnd;
using machine::ProbeRequest;
using machine::ProbeResult;
using test::kStep;
using test::ProbeBench;
using test::ProbeWay;

// [steps] On the way of a nanosecond, at the highest speed.
constexpr double kRounding = 8e-6 + 1e-6;

/// Bouncing, with a debounce time or without, and a switch that changes back later.
ProbeBench::Rig drawRig(std::mt19937& random, int i) {
  ProbeBench::Rig rig;
  rig.contact = std::uniform_real_distribution<double>(1.0, 45.0)(random);
  rig.hysteresis = i % 2 == 0 ? 0.2 : 0.0;
  rig.bounces = i % 3 == 0 ? 5 : 0;
  rig.debounce_ns = i % 6 == 0 ? 2'000'000 : 0;
  return rig;
}

ProbeRequest drawRequest(std::mt19937& random, const ProbeBench& bench, const ProbeWay& way,
                         int i) {
  ProbeRequest request = bench.over(0.05);
  request.velocity = std::uniform_real_distribution<double>(0.001, 0.1)(random);
  if (way.with_y) {
    request.positions[1] = std::uniform_real_distribution<double>(-0.05, 0.05)(random);
  }
  if (i % 5 == 0) {
    request.second_velocity = 0.002;
    request.back_off = 0.001;
  }
  request.returns = i % 4 == 0;
  return request;
}

TEST(RandomProbes, AThousandContactsOfEachAxisAreWithinHalfAStepOfTheRigsPlace) {
  const std::vector<ProbeWay> ways = test::probeWays();
  std::mt19937 random(3);
  for (int i = 0; i < 1000; ++i) {
    const ProbeWay& way = ways[random() % ways.size()];
    SCOPED_TRACE(std::to_string(i) + ": " + way.text());
    ProbeBench bench(way, drawRig(random, i));
    const ProbeRequest request = drawRequest(random, bench, way, i);
    const ProbeResult result = bench->machine->probe(request);
    ASSERT_EQ(result.end, ProbeEnd::kContact) << result.message;
    ASSERT_EQ(result.contact.size(), request.names.size());
    ASSERT_EQ(bench.contacts().size(), request.second_velocity > 0.0 ? 2U : 1U);
    const std::int64_t contact = bench.contacts().back();
    for (std::size_t axis = 0; axis < request.names.size(); ++axis) {
      const std::string& name = request.names[axis];
      const double error = result.contact[axis] / kStep - bench.jointAt(name, contact);
      ASSERT_LE(std::abs(error), 0.5 + kRounding) << name;
      // The contact of x comes with a step, in the middle between two counts.
      if (axis == 0) {
        ASSERT_NEAR(error, -0.5 * way.sign(), kRounding);
      }
      ASSERT_NEAR(result.positions[axis], bench.jointAt(name, bench->clock.now()) * kStep,
                  0.51 * kStep)
          << name;
      ASSERT_LE(std::abs(result.positions[axis]), std::abs(request.positions[axis]) + 1e-9) << name;
      if (!request.returns) continue;
      ASSERT_NEAR(result.positions[axis], result.contact[axis], 0.51 * kStep) << name;
    }
    ASSERT_EQ(test::violationsOf(bench->report()), "");
  }
}

}  // namespace
}  // namespace stepdriver
