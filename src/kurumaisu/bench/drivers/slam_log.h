// SPDX-License-Identifier: BSD-3-Clause
// What the peers' drivers share: a log in, poses and costs out. Files are of doubles, as numpy writes them.
#pragma once

#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

struct Pose {
  double x, y, theta;  ///< [m, m, rad]
};

inline double wrap(double angle) { return std::remainder(angle, 2 * M_PI); }

inline Pose compose(const Pose& a, const Pose& b) {
  const double c = std::cos(a.theta), s = std::sin(a.theta);
  return {a.x + c * b.x - s * b.y, a.y + s * b.x + c * b.y, wrap(a.theta + b.theta)};
}

inline Pose inverse(const Pose& a) {
  const double c = std::cos(a.theta), s = std::sin(a.theta);
  return {-c * a.x - s * a.y, s * a.x - c * a.y, -a.theta};
}

/// `key value` pairs of the command line, all needed and none too many.
class Arguments {
 public:
  Arguments(int count, char** words) {
    for (int i = 1; i + 1 < count; i += 2) values_[words[i]] = words[i + 1];
  }
  std::string text(const std::string& key) {
    const auto found = values_.find(key);
    if (found == values_.end()) throw std::runtime_error(key + " is missing");
    const std::string value = found->second;
    values_.erase(found);
    return value;
  }
  double number(const std::string& key) { return std::stod(text(key)); }
  void end() const {
    if (!values_.empty()) throw std::runtime_error(values_.begin()->first + " is not a known key");
  }

 private:
  std::map<std::string, std::string> values_;
};

inline std::vector<double> readDoubles(const std::string& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  std::vector<double> out(static_cast<std::size_t>(file.tellg()) / sizeof(double));
  file.seekg(0);
  file.read(reinterpret_cast<char*>(out.data()), static_cast<std::streamsize>(out.size() * sizeof(double)));
  return out;
}

inline void writeDoubles(const std::string& path, const std::vector<double>& values) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(values.data()),
             static_cast<std::streamsize>(values.size() * sizeof(double)));
}

/// A log of scans: eight numbers, then a row per scan of time, odom_from_base and ranges [m], inf = no return.
struct Log {
  explicit Log(const std::string& path) : values(readDoubles(path)) {
    beams = static_cast<std::size_t>(values.at(0));
    angle_min = values.at(1), angle_increment = values.at(2), range_min = values.at(3),
    range_max = values.at(4);
    base_from_laser = {values.at(5), values.at(6), values.at(7)};
    scans = (values.size() - kHeader) / (kBefore + beams);
  }
  const double* row(std::size_t i) const { return values.data() + kHeader + i * (kBefore + beams); }
  double time(std::size_t i) const { return row(i)[0]; }
  Pose odom(std::size_t i) const { return {row(i)[1], row(i)[2], row(i)[3]}; }
  const double* ranges(std::size_t i) const { return row(i) + kBefore; }

  static constexpr std::size_t kHeader = 8, kBefore = 4;
  std::vector<double> values;
  std::size_t beams, scans;
  double angle_min, angle_increment, range_min, range_max;
  Pose base_from_laser;
};

/// A map: width, height, resolution [m], x, y [m], then the cells, row by row from the lower left corner: 0 free to 100
/// occupied, -1 never seen.
struct Cells {
  int width, height;
  double resolution, x, y;
  std::vector<double> values;
};

/// Runs a program; prints what it throws. Returns its exit status.
template <typename Run>
int exitStatus(Run&& run, int count, char** words) {
  try {
    run(count, words);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}

inline double processorTime() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Prints processor time [s] and the memory at its most [MiB], the log's own left out. Not getrusage()'s, which
/// takes over the peak of the process that started this one.
inline void printCosts(double cpu, const Log& log) {
  std::ifstream status("/proc/self/status");
  std::string word;
  double peak = std::nan("");
  while (status >> word) {
    if (word == "VmHWM:") status >> peak;
  }
  const double mine = static_cast<double>(log.values.size() * sizeof(double)) / 1048576.0;
  std::printf("load 0\ncpu %.6f\nmemory %.3f\n", cpu, peak / 1024.0 - mine);
}
