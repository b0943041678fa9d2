// SPDX-License-Identifier: BSD-3-Clause
// Everything that may go wrong around the localiser.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <ctime>
#include <functional>
#include <stdexcept>

#include "localizer_drive.h"
#include "slam/localization/report.h"

namespace test_localizer_faults {

namespace k = kurumaisu;
using namespace room::localizing;  // NOLINT: a test

/// Before it is sure of another place it is shown where it was believed to be, with an honest deviation.
TEST(LocalizerFaults, ADoubtedPoseDoesNotLeapThroughTheMap) {
  const auto moments = faulty([](double t, k::Scan& scan, k::Pose2D&, k::Pose2D&) {
    if (t < 12 || t > 20) return;
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {  // a spiral: of no place at all
      scan.ranges[i] = 0.5F + 0.005F * static_cast<float>(i);
    }
  });
  const auto unsure = std::count_if(moments.begin(), moments.end(), [](const Moment& m) { return !sure(m); });
  EXPECT_GT(unsure, 60);
  for (std::size_t i = 1; i < moments.size(); ++i) {
    if (sure(moments[i])) continue;  // that is when it may leap
    const k::Pose2D step =
        k::between(moments[i - 1].estimate.map_from_base.mean, moments[i].estimate.map_from_base.mean);
    EXPECT_LT(std::hypot(step.x, step.y), 0.6) << moments[i].t;
  }
  EXPECT_EQ(confidentlyWrong(moments), 0);
  EXPECT_TRUE(sure(moments.back()));
  EXPECT_LT(moments.back().off, 0.06);
}

TEST(LocalizerFaults, WithoutOdometryItDoesNotClaimToKnow) {
  const auto moments = faulty([](double, k::Scan&, k::Pose2D& start, k::Pose2D& end) {
    start = end = {0, 0, 0};
  });
  EXPECT_FALSE(std::all_of(moments.begin(), moments.end(), sure));
  int wrong = 0;
  for (const Moment& m : moments) wrong = sure(m) && m.off > 0.5 ? wrong + 1 : 0;
  EXPECT_LT(wrong, 30);  // not for more than 3 s at a time
}

TEST(LocalizerFaults, AJumpOfOdometry) {
  const auto moments = faulty([](double t, k::Scan&, k::Pose2D& start, k::Pose2D& end) {
    if (t < 10) return;
    start = k::compose({1.5, -1, 0.7}, start);
    end = k::compose({1.5, -1, 0.7}, end);
  });
  EXPECT_TRUE(sure(moments.back()));
  EXPECT_LT(moments.back().off, 0.06);
}

TEST(LocalizerFaults, WheelsThatSlip) {
  double slipped = 0;  // half a metre in half a second, every ten
  expectFollowed(faulty([&slipped](double t, k::Scan&, k::Pose2D& start, k::Pose2D& end) {
                   if (std::fmod(t, 10) > 5 && std::fmod(t, 10) < 5.5) slipped += 0.1;
                   start = k::compose({slipped, 0, 0}, start);
                   end = k::compose({slipped, 0, 0}, end);
                 }),
                 0.15);
}

TEST(LocalizerFaults, FourOfFiveReadingsMissing) {
  std::mt19937 random(3);
  expectFollowed(faulty([&random](double, k::Scan& scan, k::Pose2D&, k::Pose2D&) {
                   std::bernoulli_distribution lost(0.8);
                   for (float& range : scan.ranges) range = lost(random) ? kNothing : range;
                 }),
                 0.05);
}

TEST(LocalizerFaults, PeopleAroundTheChair) {
  expectFollowed(faulty([](double t, k::Scan& scan, k::Pose2D&, k::Pose2D&) {
                   for (int i = 0; i < room::kBeams; ++i) {  // legs that wander, in front of 45 % of the view
                     const bool hidden = std::fmod(i + 40 * t, 100) < 45;
                     if (hidden) scan.ranges[i] = std::fmin(scan.ranges[i], 0.8F);
                   }
                 }),
                 0.06);
}

TEST(LocalizerFaults, ALaserThatIsMountedOtherwise) {
  const auto yawed =
      faulty([](double, k::Scan& scan, k::Pose2D&, k::Pose2D&) { scan.fan.base_from_laser.theta += 0.6; });
  EXPECT_FALSE(sure(yawed.back()) && yawed.back().turn < 0.3);  // turned it may well find itself
  const auto upside_down = faulty([](double, k::Scan& scan, k::Pose2D&, k::Pose2D&) {
    scan.fan.angle_min = -scan.fan.angle_min;
    scan.fan.angle_increment = -scan.fan.angle_increment;
  });
  EXPECT_LT(confidentlyWrong(upside_down), 40);  // of 400
  EXPECT_FALSE(sure(upside_down.back()));
}

TEST(LocalizerFaults, TheMapOfAnotherBuilding) {
  const std::vector<room::Wall> other{{-4, -3, 3.5, -3}, {3.5, -3, 3.5, 3}, {3.5, 3, -4, 3},
                                      {-4, 3, -4, -3},   {-2, -3, -2, 1},   {1, 3, 1, -1},
                                      {-2, 1, -1, 1.5},  {1, -1, 2.5, -1.4}};
  k::Localizer subject = localizer(1, room::mapOf(other, 0.05));
  subject.setPose(around(room::truth(0)));
  const auto moments = drive(subject, 0, 40);
  const auto wrong = std::count_if(moments.begin() + 30, moments.end(), sure);
  EXPECT_LT(wrong, 40);  // of 370
  EXPECT_FALSE(sure(moments.back()));
}

TEST(LocalizerFaults, MapsOfNothing) {
  for (const int value : {0, -1, 100}) {
    k::OccupancyGrid grid{0.05, 0,   0,
                          200,  160, std::vector<std::int8_t>(32000, static_cast<std::int8_t>(value))};
    k::Localizer subject(settings(), kChair, 1, grid, room::kMapFromGrid);
    subject.setPose(around(room::truth(0)));
    const auto moments = drive(subject, 0, 10);
    EXPECT_FALSE(sure(moments.back())) << value;
    EXPECT_GT(moments.back().sd, 1) << value;
  }
  for (const k::OccupancyGrid& grid :
       {k::OccupancyGrid{0.05, 0, 0, 0, 0, {}}, k::OccupancyGrid{0, 0, 0, 1, 1, {0}},
        k::OccupancyGrid{0.05, 0, 0, 2, 2, {0}}}) {
    EXPECT_THROW(localizer(1, grid), std::invalid_argument);
  }
}

TEST(LocalizerFaults, ALaserThatSeesNothing) {
  for (const float value : {kNothing, std::numeric_limits<float>::infinity(), 0.0F, -1.0F}) {
    const auto moments = faulty([value](double, k::Scan& scan, k::Pose2D&, k::Pose2D&) {
      scan.ranges.assign(scan.ranges.size(), value);
    });
    EXPECT_GT(moments.back().sd, 2 * moments[10].sd);
    EXPECT_EQ(confidentlyWrong(moments), 0);
  }
}

TEST(LocalizerFaults, SenselessScansAreRefusedAndHarmNothing) {
  k::Localizer subject = localizer();
  subject.setPose(around(room::truth(0)));
  drive(subject, 0, 3);
  std::mt19937 noise(1);
  const k::Scan good = room::scanAt(3, noise);
  k::Scan bad = good;
  bad.stamp = 1;
  EXPECT_THROW(subject.add(bad, {1, {0, 0, 0}, std::nullopt}, {0, 0, 0}), std::invalid_argument);
  bad = good;
  bad.ranges.resize(1);
  EXPECT_THROW(subject.add(bad, {3, {0, 0, 0}, std::nullopt}, {0, 0, 0}), std::invalid_argument);
  EXPECT_THROW(subject.add(good, {3, {kNothing, 0, 0}, std::nullopt}, {0, 0, 0}), std::invalid_argument);
  const auto moments = drive(subject, 3, 6);
  EXPECT_LT(moments.back().off, 0.05);
}

TEST(LocalizerFaults, AMapOf10000By10000Cells) {
  constexpr int kEdge = 10000;
  k::OccupancyGrid grid{0.05,  0,     0,
                        kEdge, kEdge, std::vector<std::int8_t>(static_cast<std::size_t>(kEdge) * kEdge, -1)};
  const k::OccupancyGrid part = room::mapOf(room::kWalls, 0.05);
  for (int y = 0; y < part.height; ++y) {
    std::copy_n(part.cells.begin() + static_cast<long>(y) * part.width, part.width,
                grid.cells.begin() + static_cast<long>(y + 6000) * kEdge + 4000);
  }
  const k::Pose2D map_from_grid{room::kMapFromGrid.x - 200, room::kMapFromGrid.y - 300, 0};
  const std::clock_t begun = std::clock();
  k::Localizer subject(settings(), kChair, 1, grid, map_from_grid);
  const double seconds = static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC;
  RecordProperty("seconds", std::to_string(seconds));
  EXPECT_LT(seconds, 15);  // of processor time, until it may begin
  rusage used{};
  ASSERT_EQ(getrusage(RUSAGE_SELF, &used), 0);
  RecordProperty("megabytes", std::to_string(used.ru_maxrss / 1024));
  EXPECT_LT(used.ru_maxrss / 1024, 800);  // the map itself among them, 100 MB
  subject.forget();
  const auto moments = drive(subject, 0, 20);
  EXPECT_TRUE(sure(moments.back()));
  EXPECT_LT(moments.back().off, 0.06);
}

TEST(LocalizationReport, SaysWhatIsWrong) {
  k::Localizer::Estimate estimate{around({0, 0, 0}), k::Knowledge::kTracking, 0.9, 0.9, 100, 0, true, false};
  const k::LocalizationState good{"", true, "", 0.1, 2, "", &estimate, 0, 0};
  EXPECT_EQ(k::judge(good).level, 0);
  const auto expect = [&good](int level, const std::string& code,
                              const std::function<void(k::LocalizationState&)>& change) {
    k::LocalizationState state = good;
    change(state);
    EXPECT_EQ(k::judge(state).level, level) << code;
    EXPECT_NE(k::judge(state).summary.find(code), std::string::npos) << k::judge(state).summary;
  };
  expect(2, "LOCALIZATION_NO_MAP", [](auto& s) { s.has_map = false; });
  expect(2, "LOCALIZATION_BAD_MAP: torn", [](auto& s) { s.bad_map = "torn"; });
  expect(2, "LOCALIZATION_NO_SCAN", [](auto& s) { s.silence = 3; });
  expect(2, "LOCALIZATION_NO_TRANSFORM", [](auto& s) { s.missing = "no odometry"; });
  expect(1, "no scan yet", [](auto& s) { s.estimate = nullptr; });
  expect(1, "LOCALIZATION_DROPPED", [](auto& s) { s.newly_dropped = 3; });
  expect(1, "LOCALIZATION_TOO_SLOW", [](auto& s) { s.newly_skipped = 3; });
  expect(2, "LOCALIZATION_NO_CLOCK: /clock", [](auto& s) { s.clock_problem = "/clock"; });
  estimate.blind = true;
  expect(1, "LOCALIZATION_BLIND", [](auto&) {});
  estimate.knowledge = k::Knowledge::kAmbiguous;
  expect(1, "LOCALIZATION_AMBIGUOUS", [](auto&) {});
  estimate.knowledge = k::Knowledge::kLost;
  expect(2, "LOCALIZATION_LOST", [](auto&) {});
}

}  // namespace test_localizer_faults
