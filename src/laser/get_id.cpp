// SPDX-License-Identifier: BSD-3-Clause
// getID: the serial number of the sensor on a port. Without ROS, MRPT and libraries of this package, so that udev can
// run it.
#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "command_line.h"
#include "laser/handshake.h"
#include "laser/link.h"
#include "laser/tcp.h"
#include "laser/tty.h"

namespace {

namespace k = kurumaisu::laser;
namespace fs = std::filesystem;

constexpr double kPatience = 3.0;       // [s] for a port, all in all: udev waits
constexpr double kAnswerTimeout = 0.3;  // [s]
constexpr int kBaud = 115200;           // [baud] on RS-232, where urg_node, too, leaves sensors
constexpr const char* kHokuyo = "15d1";
constexpr const char* kHelp = R"(usage: getID [--quiet] [PORT]...

Prints the serial number of the laser scanner at each PORT; without a PORT, of
all Hokuyo sensors on USB. Needs no ROS, for udev.

  PORT         a tty, or ADDRESS:PORT with the address in numbers
  -q, --quiet  the number only; so does -- after the PORT, as with urg_node

Exit code: 0 all answered, 1 one did not, 2 wrong usage.
More: docs/laser_node.md
)";

struct Arguments {
  bool quiet = false;
  bool help = false;
  std::vector<std::string> ports;
};

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--quiet" || word == "-q" || word == "--") {
      arguments.quiet = true;
    } else if (kurumaisu::isHelp(word)) {
      arguments.help = true;
    } else if (word.empty() || word[0] == '-') {
      throw std::invalid_argument("unknown option: " + word);
    } else {
      arguments.ports.push_back(word);
    }
  }
  return arguments;
}

/// Does a tty belong to a USB device of Hokuyo's? The ids stand some folders above the tty's own.
bool isHokuyo(const fs::path& tty) {
  std::error_code error;
  fs::path folder = fs::canonical(tty / "device", error);
  for (int i = 0; i < 3 && !error && !folder.empty(); ++i, folder = folder.parent_path()) {
    std::ifstream file(folder / "idVendor");
    std::string vendor;
    if (file >> vendor) return vendor == kHokuyo;
  }
  return false;
}

std::vector<std::string> hokuyoPorts() {
  std::vector<std::string> ports;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/sys/class/tty", error)) {
    if (isHokuyo(entry.path())) ports.push_back("/dev/" + entry.path().filename().string());
  }
  std::sort(ports.begin(), ports.end());
  return ports;
}

std::unique_ptr<k::Port> open(const std::string& name, const k::Link::Interrupted& interrupted) {
  if (name[0] == '/') return std::make_unique<k::Tty>(name, kBaud);
  const std::size_t colon = name.find(':');
  if (colon == std::string::npos) throw std::invalid_argument("neither a tty's full path nor ADDRESS:PORT");
  int port = 0;
  const char* const end = name.data() + name.size();
  const auto [stop, error] = std::from_chars(name.data() + colon + 1, end, port);
  if (error != std::errc() || stop != end) throw std::invalid_argument("its port is not a number");
  return std::make_unique<k::Tcp>(name.substr(0, colon), port, kPatience, interrupted);
}

std::string serialNumber(const std::string& name, bool ask_once) {
  const double deadline = k::steadyTime() + kPatience;
  const auto interrupted = [deadline] { return k::steadyTime() > deadline; };
  k::Link link(open(name, interrupted), k::steadyTime, interrupted);
  const k::Sensor sensor =
      k::handshake(link, {kBaud, kAnswerTimeout, ask_once},
                   [](k::Report::Level, const std::string& text) { std::cerr << text << "\n"; });
  const auto version = kurumaisu::scip::keyed(sensor.version);
  const auto found = version.find("SERI");
  if (found == version.end() || found->second.empty()) throw std::runtime_error("VV has no SERI");
  return found->second;
}

std::string serialNumber(const std::string& name) try {
  return serialNumber(name, false);
} catch (const k::WentSilent& problem) {
  std::cerr << problem.what() << "\n";
  return serialNumber(name, true);
}

bool report(const std::string& port, bool quiet) {
  try {
    const std::string serial = serialNumber(port);
    std::cout << (quiet ? serial : "Device at " + port + " has ID " + serial) << '\n';
    return true;
  } catch (const std::exception& problem) {
    std::cerr << "getID: " << port << ": " << problem.what() << "\n";
    return false;
  }
}

}  // namespace

int main(int argc, char** argv) try {
  Arguments arguments = parse(argc, argv);
  if (arguments.help) {
    std::cout << kHelp;
    return 0;
  }
  if (arguments.ports.empty()) arguments.ports = hokuyoPorts();
  if (arguments.ports.empty()) {
    std::cerr << "getID: no Hokuyo sensor on USB\n";
    return 1;
  }
  bool all = true;
  for (const std::string& port : arguments.ports) all = report(port, arguments.quiet) && all;
  return all ? 0 : 1;
} catch (const std::exception& problem) {
  return kurumaisu::misused(std::string("getID: ") + problem.what(), kHelp);
}
