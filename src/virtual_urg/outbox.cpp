// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/outbox.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace kurumaisu::virtual_urg {
namespace {

constexpr double kPieces = 100;  // at most, of an output that trickles: each costs a wake-up

/// [bytes] in a piece.
double pieceOf(const Output& output) { return std::ceil(static_cast<double>(output.bytes.size()) / kPieces); }

}  // namespace

void Outbox::add(Output output, int baud, bool is_scan) {
  bytes_ += output.bytes.size();
  if (is_scan) ++scans_;
  parcels_.push_back({std::move(output), baud, is_scan, 0, std::nullopt});
}

std::string_view Outbox::due(double now) {
  if (empty()) return {};
  Parcel& first = parcels_.front();
  if (!first.began) first.began = now;
  const std::string_view bytes = first.output.bytes;
  if (first.output.spread <= 0) return bytes.substr(first.sent);
  const double piece = pieceOf(first.output);
  const double size = static_cast<double>(bytes.size());
  const double run = size * (now - *first.began) / first.output.spread;        // [bytes]
  const double until = std::min((std::floor(run / piece) + 1) * piece, size);  // the first piece goes at once
  return bytes.substr(first.sent, std::max(static_cast<std::size_t>(until), first.sent) - first.sent);
}

double Outbox::next() const {
  if (empty() || parcels_.front().sent == parcels_.front().output.bytes.size()) return kNever;
  const Parcel& first = parcels_.front();
  const double share = static_cast<double>(first.sent) / static_cast<double>(first.output.bytes.size());
  return first.began.value_or(0) + share * first.output.spread;
}

void Outbox::sent(std::size_t bytes) {
  parcels_.front().sent += bytes;
  bytes_ -= bytes;
}

std::optional<Output> Outbox::finished() {
  if (empty() || parcels_.front().sent < parcels_.front().output.bytes.size()) return std::nullopt;
  Output output = std::move(parcels_.front().output);
  if (parcels_.front().is_scan) --scans_;
  parcels_.pop_front();
  return output;
}

void Outbox::clear() {
  parcels_.clear();
  bytes_ = 0;
  scans_ = 0;
}

}  // namespace kurumaisu::virtual_urg
