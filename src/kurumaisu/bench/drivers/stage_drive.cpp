// SPDX-License-Identifier: BSD-3-Clause
// Drives libstage 4.3 for the benchmark of poses: compiled by it, on demand, against a Stage that is built elsewhere.
//
//   stage_drive WORLD COMMANDS TRACE
//
// gives each position model its rows of the file COMMANDS (doubles; steps x models x 3: forward, leftward [m/s], turn
// [rad/s]) and writes into TRACE (doubles; steps x models x 5) x, y, z [m], heading [rad] and whether it stalled.
// Models are in the depth-first order of the world file. Prints their numbers in the order in which Stage moves them:
// by their addresses, whatever those are.
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <stage.hh>
#include <vector>

namespace {

int collect(Stg::Model* model, void* list) {
  if (auto* robot = dynamic_cast<Stg::ModelPosition*>(model))
    static_cast<std::vector<Stg::ModelPosition*>*>(list)->push_back(robot);
  return 0;
}

std::vector<double> readDoubles(const char* path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  std::vector<double> values(static_cast<std::size_t>(file.tellg()) / sizeof(double));
  file.seekg(0);
  file.read(reinterpret_cast<char*>(values.data()),
            static_cast<std::streamsize>(values.size() * sizeof(double)));
  return values;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: stage_drive WORLD COMMANDS TRACE\n";
    return 2;
  }
  Stg::Init(&argc, &argv);
  Stg::World world;
  if (!world.Load(argv[1])) return 1;
  std::vector<Stg::ModelPosition*> robots;
  world.ForEachDescendant(&collect, &robots);
  for (Stg::ModelPosition* robot : robots) robot->Subscribe();
  std::map<Stg::ModelPosition*, std::size_t> order;
  for (std::size_t i = 0; i < robots.size(); ++i) order[robots[i]] = i;
  std::cout << "\norder";
  for (const auto& robot : order) std::cout << " " << robot.second;
  std::cout << "\n";
  const std::vector<double> commands = readDoubles(argv[2]);
  std::vector<double> trace;
  for (std::size_t at = 0; at + 3 * robots.size() <= commands.size();) {
    for (Stg::ModelPosition* robot : robots) {
      robot->SetSpeed(commands[at], commands[at + 1], commands[at + 2]);
      at += 3;
    }
    world.Update();
    for (Stg::ModelPosition* robot : robots) {
      const Stg::Pose p = robot->GetGlobalPose();
      trace.insert(trace.end(), {p.x, p.y, p.z, p.a, robot->Stalled() ? 1.0 : 0.0});
    }
  }
  std::ofstream(argv[3], std::ios::binary)
      .write(reinterpret_cast<const char*>(trace.data()),
             static_cast<std::streamsize>(trace.size() * sizeof(double)));
  std::cout << std::flush;
  std::_Exit(0);  // Stage's worker threads have no end
}
