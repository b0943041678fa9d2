// SPDX-License-Identifier: BSD-3-Clause
#include "dac/settings.h"

#include <set>
#include <stdexcept>
#include <utility>

#include "dac/unfilled.h"
#include "yaml.h"

namespace kurumaisu::dac {
namespace {

constexpr int kBitsMost = 24;
constexpr int kBaudMost = 4000000;
constexpr double kWaitMost = 10;  // [s]
constexpr int kRetriesMost = 10;

using Section = YamlSection;

Band readBand(Section section) {
  const Band band{section.number("min"), section.number("max")};
  section.end();
  return band;
}

Coding readCoding(Section section, int bits) {
  Coding coding{};
  coding.per_volt = section.number("per_volt");
  if (coding.per_volt == 0) throw section.error("per_volt", "must not be 0");
  coding.at_zero = section.number("at_zero");
  const int span = 1 << bits;
  coding.min = section.integer("min", -span / 2, span - 1);
  const int most = (coding.min < 0 ? span / 2 : span) - 1;  // one bit is the sign
  coding.max = section.integer("max", coding.min + 1, most);
  section.end();
  return coding;
}

Template readTemplate(const Section& section, const std::string& key, const std::string& text,
                      Template::Kind kind) {
  try {
    return {text, kind};
  } catch (const std::invalid_argument& error) {
    throw section.error(key, std::string(error.what()) + ": " + text);
  }
}

Exchange readExchange(Section& section, Template::Kind kind) {
  const std::string send = section.text("send");
  const std::string expect = section.textOrNone("expect");
  return {readTemplate(section, "send", send, kind), readTemplate(section, "expect", expect, kind),
          !expect.empty()};
}

void readStart(Section& top, SerialSettings& serial) {
  serial.identifies = top.flag("can_identify");
  for (Section& each : top.sections("start")) {
    serial.start.push_back(readExchange(each, Template::Kind::kPlain));
    each.end();
  }
  if (serial.identifies && (serial.start.empty() || !serial.start.front().answered)) {
    throw top.error("start", "must begin with the identification and the reply to it: can_identify is true");
  }
}

/// Does a template say all it must? The frame for one channel, which channel; any, the code or the voltage of each.
void checkWrite(const Section& section, const SerialSettings& serial) {
  const Template& send = serial.write.send;
  if (!serial.one_frame) {
    if (!send.tells(Template::kThis)) throw section.error("send", "has neither {code} nor {volt}");
    if (!send.names()) throw section.error("send", "does not say which channel: {ch}");
  }
  for (const Signal signal : kWriteOrder) {
    const int told = serial.one_frame ? static_cast<int>(signal) : Template::kThis;
    if (!send.tells(told)) throw section.error("send", std::string("lacks ") + kSignalNames[signal]);
    try {
      send.checkWidth(told, serial.codings[signal]);
    } catch (const std::invalid_argument& error) {
      throw section.error("send", std::string(kSignalNames[signal]) + ": " + error.what());
    }
  }
}

void readWrite(Section section, SerialSettings& serial) {
  const std::string frame = section.choice("frame", {"channel", "burst", "all"});
  serial.one_frame = frame == "all";
  serial.burst = frame == "burst";
  serial.write = readExchange(section, serial.one_frame ? Template::Kind::kAll : Template::Kind::kChannel);
  checkWrite(section, serial);
  section.end();
}

/// The channels' own keys, which each back end has others of; read in the order of writing.
template <typename Read>
Channels readChannels(Section section, const Read& read) {
  Channels channels{};
  for (const Signal signal : kWriteOrder) {
    Section channel = section.section(kSignalNames[signal]);
    channels[signal].volt = readBand(channel.section("volt"));
    channels[signal].add_reference = signal != kReference && channel.flag("add_reference");
    read(channel, signal);
    channel.end();
  }
  section.end();
  return channels;
}

template <typename Values>
void checkDifferent(const Section& top, const Values& values) {
  if (std::set<typename Values::value_type>(values.begin(), values.end()).size() == values.size()) return;
  throw top.error("channels", "two signals share a channel of the board");
}

SerialSettings readSerial(Section& top, Channels& channels) {
  SerialSettings serial{};
  serial.port = top.text("port");
  serial.baud = top.integer("baud", 1, kBaudMost);
  serial.terminator = top.text("terminator");
  serial.reply_terminator = top.text("reply_terminator");
  serial.reply_timeout = top.within("reply_timeout", 1e-3, kWaitMost);
  serial.late_reply = top.within("late_reply", 1e-3, kWaitMost);
  serial.retries = top.integer("retries", 0, kRetriesMost);
  serial.boot = top.within("boot", 0, kWaitMost);
  if (serial.late_reply < serial.reply_timeout)
    throw top.error("late_reply", "must not be below reply_timeout");
  const int bits = top.integer("bits", 1, kBitsMost);
  channels = readChannels(top.section("channels"), [&serial, bits](Section& channel, Signal signal) {
    serial.ch[signal] = channel.text("ch");
    if (serial.ch[signal].find_first_of("*?[") != std::string::npos) {
      throw channel.error("ch",
                          "must not contain *, ? or [, which are patterns in expect: " + serial.ch[signal]);
    }
    serial.codings[signal] = readCoding(channel.section("code"), bits);
  });
  checkDifferent(top, serial.ch);
  const std::string reason = misfit(channels, serial.codings);
  if (!reason.empty()) throw top.error("channels", reason);
  readStart(top, serial);
  readWrite(top.section("write"), serial);
  return serial;
}

IioSettings readIio(Section& top, Channels& channels) {
  IioSettings iio{top.text("root"),      top.text("device"),   top.integer("bits", 1, kBitsMost),
                  top.flag("read_back"), top.flag("power_up"), {}};
  channels = readChannels(top.section("channels"), [&iio](Section& channel, Signal signal) {
    iio.index[signal] = channel.integer("index", 0);
  });
  checkDifferent(top, iio.index);
  return iio;
}

}  // namespace

Device readDevice(const std::string& file) {
  const YamlValue tree = YamlValue::load(file);
  refuseUnfilled(tree);
  Section top(tree, YamlValue::rootOf(file));
  Channels channels{};
  const bool is_serial = top.choice("kind", {"serial", "iio"}) == "serial";
  std::variant<SerialSettings, IioSettings> back_end;
  if (is_serial) {
    back_end = readSerial(top, channels);
  } else {
    back_end = readIio(top, channels);
  }
  top.end();
  return {file, channels, std::move(back_end)};
}

}  // namespace kurumaisu::dac
