// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer's target for the driver's side of the wire: what a sensor answers from the first QT until it is silent,
// through Link, handshake and ScipStream, to the bytes that MRPT reads. The first byte of an input says what is asked
// for and in what pieces the others come.
#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "fuzzing.h"
#include "laser/handshake.h"
#include "laser/link.h"
#include "laser/stream.h"

namespace l = kurumaisu::laser;
namespace s = kurumaisu::scip;
using fuzzing::require;

namespace {

constexpr double kPatience = 60;  // [s] never waited: the port does not fall silent before it is lost
constexpr std::array kAsked{"MD0044005501000", "ME0044005000000", "MD0100030003000", "MD0044072501100"};
constexpr std::uint32_t kLongestPiece = 400;  // [bytes]

/// A port on which bytes come, whatever is written to it; then it is lost.
class Script : public l::Port {
 public:
  Script(std::string bytes, std::uint32_t seed) : bytes_(std::move(bytes)), dice_(seed) {}

  std::size_t read(char* buffer, std::size_t size, double /*timeout*/) override {
    if (at_ == bytes_.size()) throw l::LinkLost("the end");
    const std::size_t count =
        std::min<std::size_t>({size, bytes_.size() - at_, 1 + dice_.roll(kLongestPiece)});
    std::memcpy(buffer, bytes_.data() + at_, count);
    at_ += count;
    return count;
  }

  void write(std::string_view bytes, double /*timeout*/) override {
    require(!bytes.empty() && bytes.size() < 40 && bytes.back() == '\n', "a command that is none");
  }

  bool hasBaud() const override { return false; }
  void setBaud(int /*baud*/) override {}

 private:
  std::string bytes_;
  std::size_t at_ = 0;
  fuzzing::Dice dice_;
};

std::string readAll(l::ScipStream& stream) {
  std::string text;
  std::array<char, 100> bytes{};
  while (const std::size_t count = stream.Read(bytes.data(), bytes.size())) text.append(bytes.data(), count);
  return text;
}

/// What MRPT is told: the very numbers.
void checkToldScan(const std::string& told, const std::string& command, const s::Rotation& rotation) {
  const std::size_t numbers = rotation.distances.size() + rotation.intensities.size();
  const auto scan = frames::read(told, command, numbers);
  require(scan.has_value(), "MRPT is told no scan");
  require(scan->clock == rotation.clock, "MRPT is told another time");
  const std::size_t stride = rotation.intensities.empty() ? 1 : 2;
  for (std::size_t k = 0; k < rotation.distances.size(); ++k) {
    require(static_cast<int>(scan->numbers[stride * k]) == rotation.distances[k],
            "MRPT is told another distance");
  }
}

void drive(const std::string& bytes, unsigned choice) {
  double now = 0;
  l::Link link(
      std::make_unique<Script>(bytes, choice), [&now] { return now += 0.01; }, [] { return false; });
  const s::Request request = s::request(kAsked[choice % kAsked.size()]).value();
  const l::Sensor sensor = l::handshake(
      link, {0, kPatience, choice % 2 == 1},
      [](auto, const std::string& text) { require(text.find("LASER_") == 0, "a warning without a code"); });
  l::ScipStream stream(link, sensor, request, kPatience);
  const std::string start = request.form == s::Form::kIntensity ? "ME0000001001000" : "MD0000001001000";
  for (const std::string& command : {std::string("BM"), std::string("PP"), std::string("VV"), start}) {
    const std::string line = command + "\n";
    stream.Write(line.data(), line.size());
    stream.rethrow();
    require(readAll(stream).compare(0, line.size(), line) == 0, "MRPT is told of another command");
  }
  fuzzing::Oracle oracle(bytes);
  std::optional<l::Arrival> last;
  bool stands = false;  // the sensor's clock
  for (;;) {
    const auto arrival = stream.await(kPatience);
    if (!arrival) continue;
    if (arrival->kind != l::Arrival::Kind::kScan) {
      require(!arrival->text.empty(), "trouble without a word");
      continue;
    }
    const bool at_once = last && arrival->first_byte - last->first_byte < 0.4 * sensor.parameters.scanTime();
    require(stands || !at_once || !(last->rotation == arrival->rotation), "the same scan twice");
    stands = last && last->rotation.clock == arrival->rotation.clock;
    last = arrival;
    oracle.checkAnswer(kAsked[choice % kAsked.size()], arrival->rotation);
    checkToldScan(readAll(stream), start, arrival->rotation);
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  try {
    drive(std::string(reinterpret_cast<const char*>(data) + 1, size - 1), data[0]);
  } catch (const l::LinkLost&) {
  } catch (const l::Refused&) {
  }
  return 0;
}

std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed) {
  return fuzzing::mutateWithSums(data, size, most, seed);
}
