// SPDX-License-Identifier: BSD-3-Clause
// What a device's YAML file says: launch/dac/*.yaml. docs/dac.md explains every key.
#pragma once

#include <array>
#include <string>
#include <variant>
#include <vector>

#include "dac/channel.h"
#include "dac/template.h"

namespace kurumaisu::dac {

/// A command and the reply that must come: a shell pattern (*, ?, [A-F]); empty for a board that does not answer.
struct Exchange {
  Template send;
  Template expect;
  bool answered = false;  ///< is expect not empty?
};

struct SerialSettings {
  std::string port;
  int baud;
  std::string terminator;        ///< of what is sent
  std::string reply_terminator;  ///< of what comes
  double reply_timeout;          ///< [s]
  double late_reply;             ///< [s] after a command was sent, its reply has come, or never will
  int retries;                   ///< of a command whose reply is missing or wrong
  double boot;                   ///< [s] after its port was opened, a board may be deaf
  std::vector<Exchange> start;   ///< identification and what else comes before the first voltage
  bool identifies;               ///< is the first of them the identification?
  bool one_frame;                ///< for all channels
  bool burst;                    ///< one for each, sent without waiting for replies in between
  Exchange write;
  std::array<std::string, kSignals> ch;
  Codings codings;
};

struct IioSettings {
  std::string root;    ///< where devices are looked for: /sys/bus/iio/devices
  std::string device;  ///< what a device's file `name` says; or its folder, if it begins with /
  int bits;
  bool read_back;                   ///< compare what the kernel says it holds with what was written
  bool power_up;                    ///< write 0 to out_voltageY_powerdown at the start
  std::array<int, kSignals> index;  ///< Y of out_voltageY_raw
};

struct Device {
  std::string file;  ///< for messages
  Channels channels;
  std::variant<SerialSettings, IioSettings> back_end;
};

/// Reads a device's file. Throws std::invalid_argument naming file, line, key and value.
Device readDevice(const std::string& file);

}  // namespace kurumaisu::dac
