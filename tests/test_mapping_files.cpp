// SPDX-License-Identifier: BSD-3-Clause
// How the mapper goes on from what it saved, and files that are wrong.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "mapper_values.h"
#include "mapping_drive.h"
#include "slam/mapping/rawlog.h"

namespace test_mapping_files {

namespace k = kurumaisu;
using namespace room::mapping;  // NOLINT: a test

namespace {

k::Gaussian about(const k::Pose2D& pose) {
  k::Gaussian out{pose, Eigen::Matrix3d::Zero()};
  out.covariance.diagonal() << 0.04, 0.04, 0.01;
  return out;
}

/// A folder of its own for each test.
class Files : public testing::Test {
 protected:
  void SetUp() override {
    char name[] = "/tmp/kurumaisu_mapping_XXXXXX";
    folder_ = mkdtemp(name);
  }
  void TearDown() override { EXPECT_EQ(std::system(("rm -r " + folder_).c_str()), 0); }

  static std::string contents(const std::string& path) {
    std::ostringstream out;
    out << std::ifstream(path).rdbuf();
    return out.str();
  }
  static bool exists(const std::string& path) { return access(path.c_str(), F_OK) == 0; }

  std::string folder_;
};

/// Files may have so many bytes: a disk that is full after them looks the same.
class LittleRoom {
 public:
  explicit LittleRoom(std::size_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit little{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &little);
  }
  ~LittleRoom() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  LittleRoom(const LittleRoom&) = delete;
  LittleRoom& operator=(const LittleRoom&) = delete;

 private:
  rlimit before_{};
  void (*handler_)(int);
};

std::string problemOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_F(Files, GoesOnFromItsSimplemap) {
  const std::string path = folder_ + "/room.simplemap";
  std::size_t kept = 0;
  {
    k::Mapper mapper(room::settings(), 1);
    drive(mapper, 0, 20);
    kept = mapper.keys().size();
    k::writeSimplemap(path, mapper.keys());
  }
  const auto keys = k::readSimplemap(path);
  ASSERT_EQ(keys.size(), kept);
  EXPECT_GT(kept, 10U);
  k::Mapper mapper(room::settings(), 2);
  auto saved = k::savedMapOf(keys, room::settings());
  EXPECT_GT(saved.grid.width, 100);
  // Somewhere else, with odometry of its own; told half a step and some degrees wrong.
  mapper.resume(saved, about(k::compose(mapFromRoom(), k::compose(room::truth(20), {0.2, -0.15, 0.08}))));
  EXPECT_EQ(mapper.grid().width, saved.grid.width);
  const auto out = drive(mapper, 20, 30, [](Moment& moment) {
    moment.start = k::compose({50, -20, 2}, moment.start);
    moment.end = k::compose({50, -20, 2}, moment.end);
  });
  EXPECT_LT(errorAt(out.front().map_from_base, 20), 0.05);
  EXPECT_LT(errorAt(out.back().map_from_base, 29.9), 0.08);
  EXPECT_GT(mapper.keys().size(), kept);
  EXPECT_EQ(mapper.keys().front().scan.ranges.size(), keys.front().scan.ranges.size());
}

TEST_F(Files, ASimplemapKeepsEveryReadingAndPose) {
  const k::Scan scan{
      12.5, {-2.0, 0.035, 0, 5.6, {0.3, 0.05, 0.1}}, {1.0F, 2.5F, std::nanf(""), INFINITY, 3.0F}};
  k::Fan clockwise = scan.fan;
  clockwise.angle_increment = -0.035;
  const std::array<double, 9> covariance{0.01, 0.001, 0, 0.001, 0.02, 0.002, 0, 0.002, 0.003};
  const std::string path = folder_ + "/two.simplemap";
  k::writeSimplemap(
      path, {{{1, 2, 0.5}, covariance, scan}, {{3, 4, -3}, covariance, {13, clockwise, scan.ranges}}});
  const auto keys = k::readSimplemap(path);
  ASSERT_EQ(keys.size(), 2U);
  EXPECT_NEAR(keys[1].map_from_base.theta, -3, 1e-9);
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(keys[0].covariance[i], covariance[i], 1e-9);
  for (const auto& key : keys) {
    EXPECT_EQ(key.scan.ranges[1], 2.5F);
    EXPECT_TRUE(std::isnan(key.scan.ranges[2]));
    EXPECT_TRUE(std::isinf(key.scan.ranges[3]));
  }
  // The same beams, wherever zero lies.
  const auto bearing = [](const k::Scan& from, int i) {
    return k::wrapAngle(from.fan.base_from_laser.theta + from.fan.angle_min + from.fan.angle_increment * i);
  };
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(bearing(keys[0].scan, i), bearing(scan, i), 1e-5);
    EXPECT_NEAR(bearing(keys[1].scan, i), bearing({13, clockwise, scan.ranges}, i), 1e-5);
  }
}

TEST_F(Files, AStartThatDoesNotFitIsSaidAndALaterOneMay) {
  k::Mapper first(room::settings(), 1);
  drive(first, 0, 10);
  const k::SavedMap saved{first.grid(), {}};
  k::Mapper mapper(room::settings(), 2);
  mapper.resume(saved, about(k::compose(mapFromRoom(), room::truth(10))));
  const k::Scan scan = room::scanAt(10, room::kUrg, room::kBeams, nullptr);
  k::Scan other = scan;
  for (std::size_t i = 0; i < other.ranges.size(); ++i)
    other.ranges[i] = 0.3F + 0.004F * static_cast<float>(i);
  EXPECT_THROW(mapper.add(other, {0, 0, 0}, {0, 0, 0}), k::StartError);
  EXPECT_TRUE(mapper.trajectory().empty());
  EXPECT_LT(errorAt(mapper.add(scan, {0, 0, 0}, {0, 0, 0}).map_from_base, 10), 0.05);
}

TEST_F(Files, GoingOnRefusesWhatMakesNoSense) {
  k::Mapper mapper(room::settings(), 1);
  k::OccupancyGrid grid{0.05, 0, 0, 2, 2, {0, 0, 100, 0}};
  k::Gaussian wide = about({0, 0, 0});
  wide.covariance(0, 0) = 4;
  EXPECT_NE(problemOf([&] { mapper.resume({grid, {}}, wide); }).find("within 1 m"), std::string::npos);
  EXPECT_NE(problemOf([&] {
              mapper.resume({{0.05, 0, 0, 0, 0, {}}, {}}, about({}));
            }).find("empty"),
            std::string::npos);
  const k::OccupancyGrid large{0.05, 0, 0, 10000, 10000, std::vector<std::int8_t>(100000000)};
  EXPECT_NE(problemOf([&] { mapper.resume({large, {}}, about({})); }).find("500"), std::string::npos);
  grid.cells = {0, 0, 0, 0};
  mapper.resume({grid, {}}, about({}));
  const k::Scan scan = room::scanAt(0, room::kUrg, room::kBeams, nullptr);
  EXPECT_NE(problemOf([&] { mapper.add(scan, {}, {}); }).find("no walls"), std::string::npos);
}

TEST_F(Files, WhatCannotBeReadIsNamed) {
  EXPECT_NE(problemOf([&] { k::readSimplemap(folder_ + "/none"); }).find("/none: cannot be read"),
            std::string::npos);
  const std::string garbage = folder_ + "/garbage";
  std::ofstream(garbage) << "no map at all";
  EXPECT_EQ(problemOf([&] { k::readSimplemap(garbage); }).find(garbage + ": "), 0U);
}

TEST_F(Files, APairIsWhatMapServerReads) {
  const k::OccupancyGrid grid{0.05, -1.5, 2, 3, 2, {0, 100, -1, 19, 66, 50}};
  k::writeMapPair(folder_ + "/it's", grid);
  EXPECT_EQ(contents(folder_ + "/it's.pgm"), std::string("P5\n3 2\n255\n\xfe\x00\xcd\xfe\x00\xcd", 17));
  const std::string text = contents(folder_ + "/it's.yaml");
  EXPECT_NE(text.find("image: 'it''s.pgm'\nresolution: 0.05\norigin: [-1.5, 2, 0.0]"), std::string::npos)
      << text;
  EXPECT_NE(text.find("occupied_thresh: 0.65\nfree_thresh: 0.196"), std::string::npos) << text;
  EXPECT_FALSE(exists(folder_ + "/it's.pgm.part"));
}

TEST_F(Files, WhatCannotBeWrittenIsNamedAndTheOldFileStays) {
  const k::OccupancyGrid grid{0.05, 0, 0, 1, 1, {0}};
  const std::string missing = folder_ + "/missing/map";
  EXPECT_NE(problemOf([&] {
              k::writeMapPair(missing, grid);
            }).find(missing + ".pgm: cannot be written: No such file"),
            std::string::npos);
  k::Mapper mapper(room::settings(), 1);
  EXPECT_NE(problemOf([&] { k::writeSimplemap(missing, mapper.keys()); }).find("nothing has been mapped"),
            std::string::npos);
  EXPECT_NE(problemOf([&] { k::writeMapPair(missing, mapper.grid()); }).find("nothing has been mapped"),
            std::string::npos);
  std::ofstream(folder_ + "/map.pgm") << "old";
  ASSERT_EQ(mkdir((folder_ + "/map.pgm.part").c_str(), 0700), 0);  // for root as well
  EXPECT_NE(problemOf([&] { k::writeMapPair(folder_ + "/map", grid); }), "");
  EXPECT_EQ(contents(folder_ + "/map.pgm"), "old");
}

TEST_F(Files, APairChangesAsAPairOrNot) {
  const k::OccupancyGrid grid{0.05, 0, 0, 1, 1, {0}};
  const std::string map = folder_ + "/map";
  std::ofstream(map + ".pgm") << "old";
  ASSERT_EQ(mkdir((map + ".yaml.part").c_str(), 0700), 0);
  EXPECT_NE(problemOf([&] { k::writeMapPair(map, grid); }).find("map.yaml: cannot be written"),
            std::string::npos);
  EXPECT_EQ(contents(map + ".pgm"), "old");
  EXPECT_FALSE(exists(map + ".pgm.part"));
}

TEST_F(Files, AFullDiskIsHeardOfAndTheOldFileStays) {
  k::Mapper mapper(room::settings(), 1);
  k::LaserLog log{};
  drive(mapper, 0, 5, [&log](Moment& moment) {
    log.fan = moment.scan.fan;
    log.beams = moment.scan.ranges.size();
    log.times.push_back(1 + moment.t);
    log.odom.push_back(moment.start);
    log.ranges.push_back(moment.scan.ranges);
  });
  for (const auto& write : std::vector<std::function<void(const std::string&)>>{
           [&](const std::string& path) { k::writeSimplemap(path, mapper.keys()); },
           [&](const std::string& path) { k::writeRawlog(path, log); },
       }) {
    const std::string path = folder_ + "/file";
    std::ofstream(path) << "old";
    for (const std::size_t bytes : {0, 100, 2000}) {
      const LittleRoom limit(bytes);
      EXPECT_NE(problemOf([&] { write(path); }).find("file: cannot be written"), std::string::npos) << bytes;
      EXPECT_EQ(contents(path), "old");
      EXPECT_FALSE(exists(path + ".part"));
    }
    EXPECT_EQ(problemOf([&] { write(path); }), "");
  }
}

TEST_F(Files, OnlyRegularFilesAreRead) {
  const std::string pipe = folder_ + "/pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(problemOf([&] { k::readSimplemap(pipe); }), pipe + ": must be a regular file");
  EXPECT_EQ(problemOf([&] { k::readRawlog(folder_); }), folder_ + ": must be a regular file");
}

}  // namespace test_mapping_files
