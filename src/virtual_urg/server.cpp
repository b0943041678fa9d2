// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/server.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>

#include "steady.h"

namespace kurumaisu::virtual_urg {
namespace {

/// Steps that a sensor measures in a turn.
std::size_t stepsOf(const Model& model) {
  const std::map<std::string, std::string> values(model.parameters.begin(), model.parameters.end());
  const int steps = std::stoi(values.at("AMAX")) - std::stoi(values.at("AMIN")) + 1;
  if (steps < 1) throw std::invalid_argument("AMAX must not be below AMIN");
  return static_cast<std::size_t>(steps);
}

}  // namespace

Server::Server(Model model, std::vector<Fault> faults, const Clock& clock, std::unique_ptr<Endpoint> endpoint,
               const Options& options)
    : options_(options),
      steps_(stepsOf(model)),
      device_(std::move(model), std::move(faults), clock, options.pace == Pace::kFed ? 0 : steadyTime()),
      endpoint_(std::move(endpoint)),
      turn_start_(steadyTime()),
      back_at_(Outbox::kNever) {
  shown_.ranges.assign(steps_, std::numeric_limits<double>::infinity());
  if (device_.isBlackHole()) endpoint_->ignore();
  thread_ = std::thread(&Server::run, this);
}

Server::~Server() { close(); }

void Server::close() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  room_.notify_all();
  wake_.set();
  if (thread_.joinable()) thread_.join();
  const std::lock_guard lock(mutex_);
  endpoint_.reset();
}

void Server::checkAlive() const {
  if (failure_) std::rethrow_exception(failure_);
  if (stopping_) throw std::runtime_error("the virtual sensor is closed");
}

void Server::show(Measurement measurement) {
  const std::lock_guard lock(mutex_);
  checkAlive();
  const auto fits = [this](std::size_t size) { return size == steps_; };
  if (!fits(measurement.ranges.size()) ||
      !(measurement.intensities.empty() || fits(measurement.intensities.size())) ||
      !(measurement.codes.empty() || fits(measurement.codes.size()))) {
    throw std::invalid_argument("a measurement must have " + std::to_string(steps_) + " steps");
  }
  shown_ = std::move(measurement);
}

bool Server::measure(const Measurement& measurement, double now) {
  std::unique_lock lock(mutex_);
  const auto ready = [this] { return stopping_ || failure_ || outbox_.empty(); };
  // Whoever was waited for in vain is not waited for again until it has read all that was kept for it.
  if (patient_) patient_ = room_.wait_for(lock, std::chrono::duration<double>(options_.patience), ready);
  checkAlive();
  fed_time_ = std::max(fed_time_, now);
  const bool kept = post(device_.measure(measurement, fed_time_), device_.baud(), true);
  lock.unlock();
  wake_.set();
  return kept;
}

void Server::advance(double now) {
  const std::lock_guard lock(mutex_);
  checkAlive();
  fed_time_ = std::max(fed_time_, now);
}

void Server::powerCycle() {
  const std::lock_guard lock(mutex_);
  checkAlive();
  outbox_.clear();
  device_.powerCycle(deviceTime());
}

std::string Server::address() const {
  const std::lock_guard lock(mutex_);
  checkAlive();
  return endpoint_->address();
}

bool Server::connected() const {
  const std::lock_guard lock(mutex_);
  return endpoint_ && endpoint_->connected();
}

Counters Server::counters() const {
  const std::lock_guard lock(mutex_);
  Counters counters = counters_;
  counters.device = device_.counts();
  return counters;
}

int Server::baud() const {
  const std::lock_guard lock(mutex_);
  return device_.baud();
}

double Server::deviceTime() const { return options_.pace == Pace::kFed ? fed_time_ : steadyTime(); }

}  // namespace kurumaisu::virtual_urg
