// SPDX-License-Identifier: BSD-3-Clause
// The localiser in a room whose scans are computed here.
#include <gtest/gtest.h>

#include "localizer_drive.h"

namespace test_localizer {

namespace k = kurumaisu;
using namespace room::localizing;  // NOLINT: a test

TEST(Localizer, FollowsTheChairBetterThanOdometry) {
  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    k::Localizer subject = localizer(seed);
    subject.setPose(around(k::compose(room::truth(0), {0.15, -0.1, 0.08})));
    const auto moments = drive(subject, 0, 40);
    const std::vector<Moment> settled(moments.begin() + 20, moments.end());
    EXPECT_LT(rootMeanSquare(settled), 0.03);
    for (const Moment& m : settled) {
      EXPECT_LT(m.turn, 0.03);
      EXPECT_LT(m.off, 4 * m.sd + 0.02);
      EXPECT_GT(m.estimate.fit, 0.8);
    }
    expectFollowed(moments, 0.1);
  }
}

TEST(Localizer, EqualSeedsGiveEqualBits) {
  k::Localizer a = localizer(5);
  k::Localizer b = localizer(5);
  k::Localizer c = localizer(6);
  for (k::Localizer* each : {&a, &b, &c}) each->setPose(around(room::truth(0)));
  const auto from_a = drive(a, 0, 10);
  const auto from_b = drive(b, 0, 10);
  const auto from_c = drive(c, 0, 10);
  bool differs = false;
  for (std::size_t i = 0; i < from_a.size(); ++i) {
    EXPECT_EQ(from_a[i].off, from_b[i].off);
    EXPECT_EQ(from_a[i].sd, from_b[i].sd);
    differs = differs || from_a[i].sd != from_c[i].sd;
  }
  EXPECT_TRUE(differs);
}

TEST(Localizer, ARotatedMapIsTheSameMap) {
  const k::Pose2D turned{3, -7, 0.8};  // of the grid's corner in the map
  const k::Pose2D map_from_room = k::compose(turned, k::between(room::kMapFromGrid, {0, 0, 0}));
  k::Localizer subject(settings(), kChair, 1, room::mapOf(room::kWalls, 0.05), turned);
  subject.setPose(around(k::compose(map_from_room, room::truth(0))));
  const auto moments = drive(subject, 0, 10);
  const k::Pose2D expected = k::compose(map_from_room, room::truth(moments.back().t));
  const auto& mean = moments.back().estimate.map_from_base.mean;
  EXPECT_LT(std::hypot(mean.x - expected.x, mean.y - expected.y), 0.05);
  EXPECT_LT(std::abs(k::wrapAngle(mean.theta - expected.theta)), 0.02);
}

TEST(Localizer, FindsItselfFromNowhere) {
  for (const double start : {0.0, 10.0, 20.0, 30.0}) {
    k::Localizer subject = localizer();
    subject.forget();
    const auto moments = drive(subject, start, start + 20);
    EXPECT_FALSE(sure(moments.front()));
    EXPECT_GT(moments.front().sd, 0.7);  // ambiguous_spread on both axes
    EXPECT_EQ(confidentlyWrong(moments), 0);
    EXPECT_TRUE(sure(moments.back()));
    EXPECT_LT(moments.back().off, 0.06);
  }
}

TEST(Localizer, NoticesThatItWasCarriedAway) {
  k::Localizer subject = localizer();
  subject.setPose(around(room::truth(0)));
  drive(subject, 0, 5);
  // Odometry goes on as if nothing had happened; the room is seen from elsewhere.
  room::Wheels wheels;
  const k::Pose2D before = wheels.at(5);
  const k::Pose2D after = wheels.at(20);
  const auto moments = drive(subject, 20, 45, [&](double, k::Scan&, k::Pose2D& start, k::Pose2D& end) {
    start = k::compose(before, k::between(after, start));
    end = k::compose(before, k::between(after, end));
  });
  const auto doubt = std::find_if_not(moments.begin(), moments.end(), sure);
  ASSERT_NE(doubt, moments.end());
  EXPECT_LT(doubt->t - 20, 3);
  EXPECT_GT(doubt->sd, 0.7);
  EXPECT_TRUE(sure(moments.back()));
  EXPECT_LT(moments.back().off, 0.06);
}

}  // namespace test_localizer
