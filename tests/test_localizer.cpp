// SPDX-License-Identifier: BSD-3-Clause
// The localiser in a room whose scans are computed here, and everything that may go wrong around it.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <ctime>
#include <functional>
#include <map>
#include <stdexcept>

#include "slam/localization_report.h"
#include "slam/localizer.h"
#include "slam_room.h"

namespace k = kurumaisu;

namespace {

constexpr double kStep = 0.1;  // [s] between scans
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

/// Written down here, so that tuning launch/localization_node.yaml cannot break this test.
k::LocalizerSettings settings() {
  const std::map<std::string, double> values{{"min_particles", 100},
                                             {"max_particles", 2000},
                                             {"kld_err", 0.05},
                                             {"kld_z", 0.99},
                                             {"update_min_d", 0.05},
                                             {"update_min_a", 0.05},
                                             {"ambiguous_spread", 0.5},
                                             {"laser_max_beams", 60},
                                             {"laser_max_range", 30},
                                             {"laser_correlation", 0.52},
                                             {"laser_sigma_hit", 0.05},
                                             {"laser_z_hit", 0.95},
                                             {"laser_z_rand", 0.05},
                                             {"laser_likelihood_max_dist", 0.4},
                                             {"laser_power", 0.2},
                                             {"odom_alpha1", 0.1},
                                             {"odom_alpha2", 0.05},
                                             {"odom_alpha3", 0.1},
                                             {"odom_alpha4", 0.01},
                                             {"odom_way_floor", 0.003},
                                             {"odom_turn_floor", 0.003},
                                             {"recovery_alpha_slow", 0.002},
                                             {"recovery_alpha_fast", 0.15},
                                             {"lost_fit", 0.5},
                                             {"lost_drop", 0.6},
                                             {"found_fit", 0.88},
                                             {"found_odds", 1000},
                                             {"found_way", 2},
                                             {"search_power", 0.05},
                                             {"search_step", 0.2},
                                             {"search_angle_step", 0.105},
                                             {"search_positions_per_scan", 5000},
                                             {"search_places", 300}};
  return k::makeLocalizerSettings([&values](const std::string& key) { return values.at(key); });
}

const k::Chair kChair{{1, 0, {0.002334, -0.000488, 0.000199}, 0.001, 0.06, 5.6}, {0, 0, 1, 0}};

k::Localizer localizer(std::uint32_t seed = 1,
                       const k::OccupancyGrid& grid = room::mapOf(room::kWalls, 0.05)) {
  return {settings(), kChair, seed, grid, room::kMapFromGrid};
}

k::Gaussian around(const k::Pose2D& pose) {
  k::Gaussian out{pose, Eigen::Matrix3d::Zero()};
  out.covariance.diagonal() << 0.04, 0.04, 0.01;
  return out;
}

struct Moment {
  double t, off, turn, sd;
  k::Localizer::Estimate estimate;
};

/// What happens to scan and odometry on their way; the odometry is that of the first and the last beam.
using Fault = std::function<void(double t, k::Scan& scan, k::Pose2D& start, k::Pose2D& end)>;

const Fault kNone = [](double, k::Scan&, k::Pose2D&, k::Pose2D&) {};

/// Drives from one time to another.
std::vector<Moment> drive(k::Localizer& localizer, double from, double to, const Fault& fault = kNone) {
  std::vector<Moment> out;
  room::Wheels wheels;
  std::mt19937 noise(7);
  for (int i = static_cast<int>(std::lround(from / kStep)); i < static_cast<int>(std::lround(to / kStep));
       ++i) {
    const double t = i * kStep;
    k::Scan scan = room::scanAt(t, noise);
    k::Pose2D start = wheels.at(t);
    k::Pose2D end = wheels.at(t + room::kUrg.time_increment * (room::kBeams - 1));
    fault(t, scan, start, end);
    const auto estimate = localizer.add(scan, {scan.stamp, start, std::nullopt}, end);
    const k::Pose2D true_pose = room::truth(t);
    const auto& mean = estimate.map_from_base.mean;
    const auto& covariance = estimate.map_from_base.covariance;
    out.push_back({t, std::hypot(mean.x - true_pose.x, mean.y - true_pose.y),
                   std::abs(k::wrapAngle(mean.theta - true_pose.theta)),
                   std::sqrt(covariance(0, 0) + covariance(1, 1)), estimate});
  }
  return out;
}

bool sure(const Moment& moment) { return moment.estimate.knowledge == k::Knowledge::kTracking; }

/// Scans at which it was sure of a place where the chair was not.
int confidentlyWrong(const std::vector<Moment>& moments) {
  return static_cast<int>(
      std::count_if(moments.begin(), moments.end(), [](const Moment& m) { return sure(m) && m.off > 0.5; }));
}

double rootMeanSquare(const std::vector<Moment>& moments) {
  double sum = 0;
  for (const Moment& m : moments) sum += m.off * m.off;
  return std::sqrt(sum / static_cast<double>(moments.size()));
}

/// Drives with a fault from the true pose on.
std::vector<Moment> faulty(const Fault& fault, double seconds = 40) {
  k::Localizer subject = localizer();
  subject.setPose(around(room::truth(0)));
  return drive(subject, 0, seconds, fault);
}

void expectFollowed(const std::vector<Moment>& moments, double limit) {
  EXPECT_LT(rootMeanSquare(moments), limit);
  EXPECT_TRUE(sure(moments.back()));
  EXPECT_EQ(confidentlyWrong(moments), 0);
}

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
  k::Localizer::Estimate estimate{around({0, 0, 0}), k::Knowledge::kTracking, 0.9, 0.9, 100, 0, true};
  const k::LocalizationState good{true, "", 0.1, 2, "", &estimate, 0, 0};
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
  estimate.knowledge = k::Knowledge::kAmbiguous;
  expect(1, "LOCALIZATION_AMBIGUOUS", [](auto&) {});
  estimate.knowledge = k::Knowledge::kLost;
  expect(2, "LOCALIZATION_LOST", [](auto&) {});
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
