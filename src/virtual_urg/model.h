// SPDX-License-Identifier: BSD-3-Clause
// What a sensor is, and what it measures: launch/urg/*.yaml, key by key.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace kurumaisu::virtual_urg {

/// `KEY:value` lines of a reply, in the order in which they are sent.
using Lines = std::vector<std::pair<std::string, std::string>>;

/// What is sent in place of a distance [mm].
struct Codes {
  int no_return = 0;  ///< nothing came back: a range of +inf
  int error = 0;      ///< a range of NaN
  int too_near = 0;   ///< a range below DMIN
  int outside = 0;    ///< a step before AMIN or after AMAX
};

/// A kind of sensor. The names are the keys of its file.
struct Model {
  std::string name;
  Lines version;     ///< VV
  Lines version_11;  ///< V of SCIP 1.1; empty: none
  Lines parameters;  ///< PP; AMIN, AMAX, ARES, DMIN, DMAX, SCAN are what it does, too
  Lines state;       ///< II; {laser} {mode} {rpm} {baud} {time} {health} stand for what is true then

  std::string laser_on;   ///< {laser}
  std::string laser_off;  ///< {laser}
  std::string idle;       ///< {mode}
  std::string measuring;  ///< {mode}
  std::string healthy;    ///< {health}
  std::string ill;        ///< {health} after DB or a hardware status

  std::map<std::string, std::string> refused;  ///< commands it has not (two letters), and their status

  int protocol = 2;        ///< at power-up: 1 = SCIP 1.1, 2 = SCIP 2.0
  int baud = 0;            ///< [bit/s] at power-up; 0: it has no bit rate
  std::vector<int> bauds;  ///< [bit/s] that SS can set
  int end_step = 0;        ///< last step that may be asked for
  Codes codes;
  double boot_time = 0;     ///< [s] from power-up until it hears
  double output_delay = 0;  ///< [s] from AMAX until the first byte of a scan

  bool bad_serial_sum = false;  ///< quirk: the sum of SERI in VV is wrong
};

/// One rotation.
struct Measurement {
  double start = 0;                 ///< [s] world's time when the mirror was at step 0
  std::vector<double> ranges;       ///< [m] AMIN to AMAX; NaN: error, +inf: no return
  std::vector<double> intensities;  ///< AMIN to AMAX, or none
  std::vector<int> codes;           ///< AMIN to AMAX: distances as sent [mm] instead of ranges, or none
};

}  // namespace kurumaisu::virtual_urg
