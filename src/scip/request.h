// SPDX-License-Identifier: BSD-3-Clause
// What a client may ask to be measured.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace kurumaisu::scip {

/// How the beams of a scan are written.
enum class Form : char {
  kDistance = 'D',   ///< three characters a beam
  kShort = 'S',      ///< two
  kIntensity = 'E',  ///< three of distance, three of intensity
};

/// A measurement command: MD, MS, ME (a stream of scans) or GD, GS, GE (one).
struct Request {
  bool stream = true;
  Form form = Form::kDistance;
  int first = 0;     ///< step, counted from the rear, counter-clockwise
  int last = 0;      ///< step, measured too
  int cluster = 1;   ///< steps joined into a beam, at least 1 (0 on the wire means 1)
  int interval = 0;  ///< scans left out between two; of a stream
  int count = 0;     ///< scans, 0 = endless; of a stream
};

/// Scan beams of it: the last one may hold fewer steps than a cluster.
int beams(const Request& request);

/// Characters of one beam.
int width(Form form);

/// The command, without its LF: MDssssEEEEccinn or GDssssEEEEcc.
std::string command(const Request& request);

/// The request that a command makes; none if it is another command or not of the right digits.
std::optional<Request> request(std::string_view command);

/// Does an echo answer this request? A stream's echoes count down their scans.
bool answers(std::string_view echo, const Request& request);

}  // namespace kurumaisu::scip
