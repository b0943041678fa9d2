// SPDX-License-Identifier: BSD-3-Clause
// Drives libstage 4.3 for the benchmarks: compiled by them, on demand, against a Stage that is built elsewhere.
//
//   stage scan WORLD POSES RANGES   the first position model at each pose of the file POSES (x, y [m], heading [rad];
//                                   doubles), its rangers' beams into the file RANGES: range [m], number of the
//                                   model met in depth-first order of the world file (doubles)
//   stage run WORLD SECONDS V W     all position models at v [m/s], w [rad/s] for so many simulated seconds
//   stage poses WORLD SECONDS V W   the same, then their poses
//
// Prints "key value" lines: seconds of CPU time, MiB of memory, poses.
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iostream>
#include <stage.hh>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

double cpuSeconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Of this process [MiB]; getrusage would count that of its parent too.
double peakMemory() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kilobytes = 0;
    if (word == "VmHWM:" && status >> kilobytes) return kilobytes / 1024;
  }
  throw std::runtime_error("/proc/self/status has no VmHWM");
}

int collect(Stg::Model* model, void* list) {
  static_cast<std::vector<Stg::Model*>*>(list)->push_back(model);
  return 0;
}

template <typename Kind>
std::vector<Kind*> all(Stg::Ancestor& top) {
  std::vector<Stg::Model*> models;
  top.ForEachDescendant(&collect, &models);
  std::vector<Kind*> found;
  for (Stg::Model* model : models) {
    if (auto* kind = dynamic_cast<Kind*>(model)) found.push_back(kind);
  }
  return found;
}

std::vector<double> readDoubles(const char* path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  std::vector<double> values(static_cast<std::size_t>(file.tellg()) / sizeof(double));
  file.seekg(0);
  file.read(reinterpret_cast<char*>(values.data()),
            static_cast<std::streamsize>(values.size() * sizeof(double)));
  if (!file) throw std::runtime_error(std::string(path) + " is not readable");
  return values;
}

/// Has rangers report which model they meet in place of its intensity.
void number(Stg::World& world) {
  double i = 0;
  for (Stg::Model* model : all<Stg::Model>(world)) {
    if (model == world.GetGround()) continue;  // is in no world file
    if (model->vis.ranger_return >= 0) model->vis.ranger_return = i;
    ++i;
  }
  std::cout << "models " << i << "\n";
}

void scan(Stg::World& world, const char* poses_path, const char* ranges_path) {
  number(world);
  Stg::Model* robot = all<Stg::ModelPosition>(world).at(0);
  const auto rangers = all<Stg::ModelRanger>(*robot);
  const std::vector<double> poses = readDoubles(poses_path);
  std::vector<double> readings;
  double cpu = 0;
  for (int pass = 0; pass < 2; ++pass) {  // the first one warms caches up
    readings.clear();
    cpu = 0;
    for (std::size_t i = 0; i + 2 < poses.size(); i += 3) {
      const Stg::Pose old = robot->GetGlobalPose();
      robot->SetGlobalPose(Stg::Pose(poses[i], poses[i + 1], old.z, poses[i + 2]));
      const double start = cpuSeconds();
      for (Stg::ModelRanger* ranger : rangers) {
        for (auto& sensor : ranger->GetSensorsMutable()) sensor.Update(ranger);
      }
      cpu += cpuSeconds() - start;
      for (Stg::ModelRanger* ranger : rangers) {
        for (const auto& sensor : ranger->GetSensors()) {
          for (std::size_t j = 0; j < sensor.ranges.size(); ++j) {
            readings.push_back(sensor.ranges[j]);
            readings.push_back(sensor.intensities[j]);
          }
        }
      }
    }
  }
  std::ofstream(ranges_path, std::ios::binary)
      .write(reinterpret_cast<const char*>(readings.data()),
             static_cast<std::streamsize>(readings.size() * sizeof(double)));
  std::cout << "cpu " << cpu << "\nrays " << readings.size() / 2 << "\n";
}

void run(Stg::World& world, double seconds, double v, double w, bool print_poses) {
  const auto robots = all<Stg::ModelPosition>(world);
  for (Stg::ModelRanger* ranger : all<Stg::ModelRanger>(world)) ranger->Subscribe();
  for (Stg::ModelPosition* robot : robots) {
    robot->Subscribe();
    robot->SetSpeed(v, 0, w);
  }
  const double start = cpuSeconds();
  while (static_cast<double>(world.SimTimeNow()) < 1e6 * seconds - 1 && !world.Update()) {
  }
  std::cout << "cpu " << cpuSeconds() - start << "\n";
  if (!print_poses) return;
  for (Stg::ModelPosition* robot : robots) {
    const Stg::Pose p = robot->GetGlobalPose();
    std::printf("pose %.9g %.9g %.9g %.9g\n", p.x, p.y, p.z, p.a);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 6 && !(argc == 5 && std::string(argv[1]) == "scan")) {
    std::cerr << "usage: stage scan WORLD POSES RANGES | stage run|poses WORLD SECONDS V W\n";
    return 2;
  }
  const std::string task = argv[1];
  Stg::Init(&argc, &argv);
  const double start = cpuSeconds();
  Stg::World world;
  if (!world.Load(argv[2])) return 1;
  std::cout << "load " << cpuSeconds() - start << "\n";
  if (task == "scan") {
    scan(world, argv[3], argv[4]);
  } else {
    run(world, std::atof(argv[3]), std::atof(argv[4]), std::atof(argv[5]), task == "poses");
  }
  std::cout << "memory " << peakMemory() << "\n" << std::flush;
  std::_Exit(0);  // Stage's worker threads have no end
}
