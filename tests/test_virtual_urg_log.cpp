// SPDX-License-Identifier: BSD-3-Clause
// A real URG-04LX's 13.5 s, asked again of the virtual one: every byte must be the same.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "scip/scan.h"
#include "virtual_sensor.h"

namespace test_virtual_urg_log {

namespace s = kurumaisu::scip;
namespace v = kurumaisu::virtual_urg;

namespace {

/// Beside the repository, whose folders the workspace links.
std::string logPath() {
  return std::filesystem::canonical(SOURCE_DIR "/tests").parent_path().parent_path() /
         "shared/data/player_urg04lx/hokuyo_aist.log";
}

/// The bytes of a log: records of big-endian u32 seconds, microseconds, length, then so many bytes.
std::string bytesOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string log{std::istreambuf_iterator<char>(file), {}};
  std::string bytes;
  for (std::size_t at = 0; at + 12 <= log.size();) {
    std::size_t length = 0;
    for (std::size_t i = at + 8; i < at + 12; ++i) length = length << 8U | static_cast<unsigned char>(log[i]);
    bytes += log.substr(at + 12, length);
    at += 12 + length;
  }
  return bytes;
}

std::vector<std::string> cut(const std::string& bytes, const std::string& end) {
  std::vector<std::string> parts;
  for (std::size_t at = 0, stop = 0; (stop = bytes.find(end, at)) != std::string::npos; at = stop)
    parts.push_back(bytes.substr(at, (stop += end.size()) - at));
  return parts;
}

/// The sensor's time when it answered [s]; none where the reply does not tell.
std::optional<double> timeOf(const std::string& reply) {
  const std::size_t time = reply.find("\nTIME:");
  if (time == std::string::npos) return std::nullopt;
  return std::stoi(reply.substr(time + 6, 6), nullptr, 16) / 1000.0;
}

/// The turn that a recorded scan saw.
v::Measurement turnOf(const std::string& reply, const s::Request& request) {
  s::Assembler assembler;
  assembler.add(reply, 0);
  const s::Rotation scan = s::decodeScan(assembler.next().value(), request);
  v::Measurement turn;
  turn.start = scan.clock / 1000.0;
  turn.codes.assign(682, 0);
  std::copy(scan.distances.begin(), scan.distances.end(), turn.codes.begin() + request.first - 44);
  return turn;
}

v::Model recordedUnit() {
  v::Model model = v::shipped("urg_04lx");
  for (v::Lines* lines : {&model.version, &model.version_11}) {
    for (auto& [key, value] : *lines) value = key == "SERI" ? "H0706400" : value;
  }
  return model;
}

}  // namespace

TEST(VirtualUrgLog, AnswersAsTheRealOneDidByteForByte) {
  const std::string log = logPath();
  if (!std::ifstream(log + "r")) GTEST_SKIP() << "no recording at " << log << "r";
  const std::vector<std::string> commands = cut(bytesOf(log + "w"), "\n");
  std::string received = bytesOf(log + "r");
  // The recorder threw away what followed the last line that it wanted of V: the empty line.
  received.insert(received.find("SCIP2.0\n"), "\n");
  const std::vector<std::string> replies = cut(received, "\n\n");
  ASSERT_EQ(commands.size(), 136U);
  ASSERT_EQ(replies.size(), 135U);  // the last one came after its end
  v::Device device(recordedUnit(), {}, {}, 0);
  int scans = 0;
  double now = 0;
  for (std::size_t i = 0; i < replies.size(); ++i) {
    now = timeOf(replies[i]).value_or(now);
    std::string answer = device.receive(commands[i], now).bytes;
    if (const auto request = s::request(commands[i].substr(0, commands[i].size() - 1)); request) {
      EXPECT_EQ(answer, "");
      const v::Measurement turn = turnOf(replies[i], *request);
      answer = device.measure(turn, now = turn.start).bytes;
      ++scans;
    }
    ASSERT_EQ(answer, replies[i]) << "to command " << i << ", " << commands[i];
  }
  EXPECT_EQ(scans, 121);
}

}  // namespace test_virtual_urg_log
