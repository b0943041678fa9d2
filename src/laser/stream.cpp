// SPDX-License-Identifier: BSD-3-Clause
#include "laser/stream.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "scip/code.h"

namespace kurumaisu::laser {
namespace {

std::string line(const std::string& key, int value) { return key + ":" + std::to_string(value) + ";"; }

void checkLaser(const std::string& status) {
  const bool is_broken = status == "01";
  if (!is_broken && status != "10") return;
  throw Refused("LASER_NO_LIGHT: BM is answered by status " + status +
                (is_broken ? ": the laser is out of order" : ": not yet ready"));
}

bool isStart(const std::string& command) { return scip::request(command).has_value(); }

}  // namespace

ScipStream::ScipStream(Link& link, const Sensor& sensor, const scip::Request& request, double answer_timeout)
    : link_(link), sensor_(sensor), request_(request), answer_timeout_(answer_timeout) {
  if (request.form == scip::Form::kShort) throw std::invalid_argument("MRPT does not know MS");
}

std::optional<Arrival> ScipStream::await(double timeout) {
  const std::optional<scip::Message> message = link_.next(timeout);
  if (!message) return std::nullopt;
  const bool is_scan = message->status == "99";
  const bool is_late = !scip::answers(message->command, request_) || message->status == "00";
  if (!is_scan && is_late) return std::nullopt;  // an answer to what was asked before
  if (!is_scan) return Arrival{Arrival::Kind::kStatus, {}, message->first_byte, message->status};
  try {
    Arrival arrival{Arrival::Kind::kScan, scip::decodeScan(*message, request_), message->first_byte, {}};
    if (isDuplicate(arrival)) {
      return Arrival{Arrival::Kind::kDuplicate,
                     {},
                     message->first_byte,
                     "clock " + std::to_string(arrival.rotation.clock)};
    }
    last_ = arrival;
    put(started_, message->status, message->lines);
    return arrival;
  } catch (const scip::BadFrame& problem) {
    return Arrival{Arrival::Kind::kDamaged, {}, message->first_byte, problem.what()};
  }
}

/// The same again at once. A turn later it is a clock that stands: then nothing tells a scan from the one before.
bool ScipStream::isDuplicate(const Arrival& arrival) {
  constexpr double kAtOnce = 0.5;  // of the time from scan to scan
  const bool same_clock = last_ && last_->rotation.clock == arrival.rotation.clock;
  const double period = sensor_.parameters.scanTime() * (request_.interval + 1);
  const bool is_duplicate = same_clock && !stands_ && last_->rotation == arrival.rotation &&
                            std::abs(arrival.first_byte - last_->first_byte) < kAtOnce * period;
  if (!is_duplicate) stands_ = same_clock;
  return is_duplicate;
}

void ScipStream::rethrow() const {
  if (failure_) std::rethrow_exception(failure_);
}

std::size_t ScipStream::Read(void* buffer, std::size_t size) {
  const std::size_t count = std::min(size, ready_.size() - read_);
  std::memcpy(buffer, ready_.data() + read_, count);
  read_ += count;
  return count;
}

std::size_t ScipStream::Write(const void* buffer, std::size_t size) {
  if (failure_) return size;
  try {
    std::string command(static_cast<const char*>(buffer), size);
    command.erase(command.find_last_not_of('\n') + 1);
    answer(command);
  } catch (...) {
    failure_ = std::current_exception();
  }
  return size;
}

void ScipStream::answer(const std::string& command) {
  if (command == "PP") {
    put(command, "00", plainFan());
  } else if (command == "VV") {
    put(command, "00", sensor_.version.lines);
  } else if (command == "SCIP2.0") {
    put(command, "0E", {});  // it speaks it already
  } else if (isStart(command)) {
    start(command);
  } else {
    const scip::Message reply = link_.ask(command, answer_timeout_);
    if (command == "BM") checkLaser(reply.status);
    put(command, reply.status, reply.lines);
  }
}

void ScipStream::start(const std::string& command) {
  const std::string asked = scip::command(request_);
  const std::string status = link_.ask(asked, answer_timeout_).status;
  if (request_.form == scip::Form::kIntensity && status[0] == '0' && status != "00") {
    throw NoIntensity("LASER_NO_INTENSITY: " + asked + " is answered by status " + status +
                      "; scans have none");
  }
  if (status != "00") throw Refused("LASER_REFUSED: " + asked + " is answered by status " + status);
  started_ = command;
  put(command, status, {});
}

void ScipStream::put(const std::string& command, const std::string& status,
                     const std::vector<std::string>& lines) {
  ready_ = command + "\n" + status + scip::sum(status) + "\n";
  for (const std::string& line : lines) ready_ += line + scip::sum(line) + "\n";
  ready_ += '\n';
  read_ = 0;
}

/// The beams of the window, as if they were a whole sensor's. Only their number matters to MRPT.
std::vector<std::string> ScipStream::plainFan() const {
  const scip::Parameters& sensor = sensor_.parameters;
  return {"MODL:" + sensor.model + ";",
          line("DMIN", sensor.distance_min),
          line("DMAX", sensor.distance_max),
          line("ARES", std::max(sensor.steps_per_turn / request_.cluster, 1)),
          line("AMIN", 0),
          line("AMAX", scip::beams(request_) - 1),
          line("AFRT", std::max((sensor.front - request_.first) / request_.cluster, 0)),
          line("SCAN", static_cast<int>(sensor.rpm))};
}

}  // namespace kurumaisu::laser
