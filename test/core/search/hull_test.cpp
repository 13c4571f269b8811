#include "search/hull.h"

#include <gtest/gtest.h>

namespace stepdriver::search {
namespace {

TEST(Hull, LetsPulsesLeadWhereRequestsLead) {
  Hull hull;
  hull.begin(100.0, 1.0);
  hull.allow(300.0);
  hull.pass(99.0);
  hull.pass(301.0);
  EXPECT_EQ(hull.broken(), "");
  hull.pass(302.0);
  EXPECT_EQ(hull.broken(),
            "was from 99.000000 to 302.000000, but its requests lead from 100.000000 to "
            "300.000000");
}

TEST(Hull, SeesAWayBackBeyondTheBegin) {
  Hull hull;
  hull.begin(100.0, 1.0);
  hull.allow(300.0);
  hull.pass(98.0);
  EXPECT_NE(hull.broken(), "");
}

TEST(Hull, BeginsAnewAtRest) {
  Hull hull;
  hull.begin(0.0, 1.0);
  hull.allow(1000.0);
  hull.begin(500.0, 1.0);
  hull.allow(510.0);
  hull.pass(505.0);
  EXPECT_EQ(hull.broken(), "");
  hull.pass(600.0);
  EXPECT_NE(hull.broken(), "");
}

TEST(Hull, OfAJogHasNoEnd) {
  Hull hull;
  hull.begin(0.0, 1.0);
  hull.allowAnything();
  hull.pass(1e9);
  hull.pass(-1e9);
  EXPECT_EQ(hull.broken(), "");
}

}  // namespace
}  // namespace stepdriver::search
