// SPDX-License-Identifier: BSD-3-Clause
// The strict reader of YAML files, and devices' files through it: what is shipped is read, what is wrong is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "dac_rig.h"
#include "yaml.h"

namespace test_dac_settings {

namespace k = kurumaisu;
namespace d = kurumaisu::dac;
using d::complaint;
using d::has;

namespace {

const char* const kText =
    "rate: 50.0\n"
    "count: 3\n"
    "word: odom\n"
    "quoted: \"12\"\n"
    "on_off: true\n"
    "exponent: 1e-3\n"
    "inner: {x: 1.5}\n"
    "list: [1, 2.5, -3.0e+2]\n"
    "steps:\n"
    "  - {a: 1}\n"
    "  - {a: 2}\n";

struct Read {
  explicit Read(const std::string& text) : file(d::written(folder, "some.yaml", text)) {}
  k::YamlSection section() const { return k::YamlSection::load(file); }
  std::string refusal(const std::function<void(k::YamlSection&)>& action) const {
    return complaint<std::invalid_argument>([&] {
      k::YamlSection top = section();
      action(top);
    });
  }
  d::Folder folder;
  std::string file;
};

std::string refusalOf(const std::string& preset, const d::Edits& edits) {
  const d::Folder folder;
  const std::string file = written(folder, "device.yaml", d::edited(d::textOf(d::shipped(preset)), edits));
  return complaint<std::invalid_argument>([&] { d::readDevice(file); });
}

}  // namespace

TEST(Yaml, TakesEveryKeyOnce) {
  const Read read(kText);
  k::YamlSection top = read.section();
  EXPECT_EQ(top.number("rate"), 50.0);
  EXPECT_EQ(top.integer("count", 0), 3);
  EXPECT_EQ(top.text("word"), "odom");
  EXPECT_EQ(top.text("quoted"), "12");
  EXPECT_TRUE(top.flag("on_off"));
  EXPECT_EQ(top.text("exponent"), "1e-3");
  EXPECT_EQ(top.numbers("list", 3), (std::vector<double>{1, 2.5, -300}));
  std::vector<k::YamlSection> steps = top.sections("steps");
  EXPECT_EQ(steps.size(), 2U);
  EXPECT_EQ(steps[1].integer("a", 0), 2);
  EXPECT_EQ(top.names(), (std::vector<std::string>{"inner"}));
  EXPECT_THROW(top.number("rate"), std::invalid_argument);
  EXPECT_THROW(top.end(), std::invalid_argument);
  EXPECT_EQ(top.section("inner").number("x"), 1.5);
  EXPECT_NO_THROW(top.end());
}

TEST(Yaml, MessagesNameFileLineKeyAndValue) {
  const Read read(kText);
  using Section = k::YamlSection;
  const std::string place = read.file + ":";
  EXPECT_EQ(read.refusal([](Section& top) { top.number("rat"); }), place + "1: rat: is missing");
  EXPECT_EQ(read.refusal([](Section& top) { top.above("rate", 50); }),
            place + "1: rate: must be above 50: 50");
  EXPECT_EQ(read.refusal([](Section& top) { top.integer("rate", 0); }),
            place + "1: rate: must be an integer, not 50.0");
  EXPECT_EQ(read.refusal([](Section& top) { top.number("exponent"); }),
            place + "6: exponent: must be a number, not 1e-3, a string (YAML wants 1.0e-3, not 1e-3)");
  EXPECT_EQ(read.refusal([](Section& top) { top.number("quoted"); }),
            place + "4: quoted: must be a number, not 12, a string (YAML wants 1.0e-3, not 1e-3)");
  EXPECT_EQ(read.refusal([](Section& top) { top.section("inner").above("x", 2); }),
            place + "7: inner/x: must be above 2: 1.5");
  EXPECT_EQ(read.refusal([](Section& top) { top.section("inner").end(); }),
            place + "7: inner/x: is not a known key; its value is 1.5");
  EXPECT_EQ(read.refusal([](Section& top) { top.sections("steps")[1].number("b"); }),
            place + "11: steps[1]/b: is missing");
  EXPECT_EQ(read.refusal([](Section& top) { top.section("list"); }),
            place + "8: list: must be a mapping, not a list");
  EXPECT_EQ(read.refusal([](Section& top) { top.text("count"); }),
            place + "2: count: must be a string, not 3");
}

TEST(Yaml, ScalarsAreWhatYamlTakesThemFor) {
  using k::Kind;
  for (const auto& [text, kind] : std::vector<std::pair<std::string, Kind>>{
           {"0", Kind::kInteger},        {"-12", Kind::kInteger},  {"+7", Kind::kInteger},
           {"007", Kind::kText},         {"0x1F", Kind::kText},    {"1_000", Kind::kText},
           {"99999999999", Kind::kText}, {"1.", Kind::kNumber},    {".5", Kind::kNumber},
           {"-1.5e+3", Kind::kNumber},   {"1.5e3", Kind::kText},   {"1e3", Kind::kText},
           {".inf", Kind::kNumber},      {".nan", Kind::kNumber},  {"inf", Kind::kText},
           {"~", Kind::kNone},           {"null", Kind::kNone},    {"", Kind::kNone},
           {"'1'", Kind::kText},         {"\"\"", Kind::kText},    {"false", Kind::kFlag},
           {"yes", Kind::kText},         {"!!int 3", Kind::kText}, {std::string(9999, '1'), Kind::kText},
           {"1.0e+999", Kind::kNumber},  {"a b", Kind::kText},     {".", Kind::kText},
           {"[]", Kind::kList},          {"{}", Kind::kMapping},   {"2026-01-01", Kind::kText}}) {
    const Read read("key: " + text + "\n");
    EXPECT_EQ(k::YamlValue::load(read.file).mapping().at("key").kind(), kind) << text;
  }
  for (const char* text : {".inf", "-.inf", ".nan", "1.0e+999"}) {
    EXPECT_TRUE(
        has(Read(std::string("key: ") + text).refusal([](auto& top) { top.number("key"); }), "finite"))
        << text;
  }
}

TEST(Yaml, RefusesFilesThatAreNotRegularOrTooLargeAndCutsValues) {
  for (const char* name : {"/dev/zero", "/tmp"}) {
    EXPECT_TRUE(
        has(complaint<std::invalid_argument>([&] { k::YamlValue::load(name); }), "must be a regular file"));
  }
  EXPECT_TRUE(has(Read(std::string(2000000, '#')).refusal([](auto&) {}), "at most 1048576 are read"));
  const std::string said =
      Read("key: " + std::string(50000, 'x')).refusal([](auto& top) { top.number("key"); });
  EXPECT_TRUE(has(said, "xxx..."));
  EXPECT_LT(said.size(), 400U);
}

TEST(Yaml, RefusesFilesThatAreNone) {
  EXPECT_TRUE(
      has(complaint<std::invalid_argument>([] { k::YamlValue::load("/no/such.yaml"); }), "/no/such.yaml"));
  for (const auto& [text, part] :
       std::vector<std::pair<std::string, std::string>>{{"a: 1\nb: [1,\n", ":"},
                                                        {"a: 1\na: 2\n", ":2: a: is given twice"},
                                                        {"a: {b: 1, c: 2, b: 3}\n", "b: is given twice"},
                                                        {"a: 1\n---\nb: 2\n", "one document, not 2"},
                                                        {"", "one document, not 0"},
                                                        {"- 1\n", "must be a mapping, not a list"},
                                                        {"[a]: 1\n", "a key must be a word"},
                                                        {"a: *b\n", ":1:"},
                                                        {"a: \"\n", ":"},
                                                        {std::string("a: \xff\xfe\n"), ""},
                                                        {std::string(100000, '['), ""},
                                                        {"a: &x {b: *x}\n", ""}}) {
    const Read read(text);
    const std::string message = read.refusal([](auto& top) { top.section("a").end(); });
    EXPECT_TRUE(has(message, read.file) && has(message, part))
        << text.substr(0, 40) << ": " << message.substr(0, 200);
  }
}

TEST(DacSettings, WhatIsShippedIsRead) {
  const d::Device serial = d::readDevice(d::shipped("serial_ascii.yaml"));
  EXPECT_EQ(std::get<d::SerialSettings>(serial.back_end).terminator, "\r");
  EXPECT_EQ(std::get<d::SerialSettings>(serial.back_end).start.size(), 2U);
  EXPECT_TRUE(serial.channels[d::kTranslation].add_reference);
  for (const char* name : {"mcp4728.yaml", "ad5592r.yaml"}) {
    EXPECT_EQ(std::get<d::IioSettings>(d::readDevice(d::shipped(name)).back_end).bits, 12) << name;
  }
}

TEST(DacSettings, NothingElseIsShipped) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(d::shipped("")))
    names.insert(entry.path().filename());
  EXPECT_EQ(names, (std::set<std::string>{"serial_ascii.yaml", "mcp4728.yaml", "ad5592r.yaml",
                                          "dacs_82ada_unverified.yaml"}));
}

TEST(DacSettings, WhatNobodyKnowsIsNotGuessed) {
  const std::string file = d::shipped("dacs_82ada_unverified.yaml");
  const std::string message = complaint<std::invalid_argument>([&] { d::readDevice(file); });
  for (const char* part :
       {"owner", "manual", "analogue output command", "codes per volt", "bits", "ftdi_sio"}) {
    EXPECT_TRUE(has(message, part)) << part << "\n" << message;
  }
  EXPECT_TRUE(has(message, file + ":")) << "with its lines";
  std::string text = d::textOf(file);
  int open = 0;
  for (std::size_t at = text.find("\"FILL IN"); at != std::string::npos; at = text.find("\"FILL IN", at + 1))
    ++open;
  EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), open) << "each in a line of its own";
}

TEST(DacSettings, RefusesWhatIsWrongInASerialDevice) {
  const std::vector<std::pair<d::Edits, std::string>> cases{
      {{{"kind: serial", "kind: usb"}}, "kind: must be one of serial, iio: usb"},
      {{{"retries: 1 ", "tries: 1 "}}, "retries: is missing"},
      {{{"boot: 3.0", "boot: -1"}}, "boot: must be"},
      {{{"bits: 12", "bits: 12\nextra: 1"}}, "extra: is not a known key"},
      {{{"baud: 115200", "baud: 115200.0"}}, "baud: must be an integer"},
      {{{"baud: 115200", "baud: 0"}}, "baud: must be at least 1"},
      {{{"terminator: \"\\r\" ", "terminator: \"\" "}}, "terminator: must not be empty"},
      {{{"reply_timeout: 0.05", "reply_timeout: 0.0"}}, "reply_timeout: must be from"},
      {{{"late_reply: 0.1", "late_reply: 0.02"}}, "late_reply: must not be below reply_timeout"},
      {{{"frame: channel", "frame: each"}}, "write/frame: must be one of channel, burst, all"},
      {{{"W{ch}{code:04X}", "W{ch}{kode:04X}"}}, "write/send: placeholder {kode:04X}: is unknown"},
      {{{"W{ch}{code:04X}", "W{code:04X}"}}, "write/send: does not say which channel"},
      {{{"W{ch}{code:04X}", "W{ch}"}}, "write/send: has neither"},
      {{{"W{ch}{code:04X}", "W{ch}{code:02X}"}}, "code 4095 does not fit into 2 characters"},
      {{{"OK {ch}{code:04X}", "OK {answer}"}}, "write/expect: placeholder {answer}"},
      {{{"frame: channel", "frame: all"}}, "write/send: placeholder {ch}"},
      {{{"ID?\"", "ID{ch}\""}}, "start[0]/send: placeholder {ch}: there is nothing to fill in here"},
      {{{"ASCII-DAC *", ""}}, "start: must begin with the identification"},
      {{{"bits: 12", "bits: 11"}}, "channels/reference/code/max: must be at most 2047: 4095"},
      {{{"bits: 12", "bits: 31"}}, "bits: must be at most 24"},
      {{{"min: 0, max: 4095", "min: 4095, max: 4095"}}, "code/max: must be at least 4096"},
      {{{"per_volt: 819.0", "per_volt: 0.0"}}, "code/per_volt: must not be 0"},
      {{{"per_volt: 819.0", "per_volt: 1e3"}}, "code/per_volt: must be a number"},
      {{{"per_volt: 819.0", "per_volt: 1638.0"}}, "channels: reference: volt reaches from code"},
      {{{"volt: {min: -1.0, max: 1.0}", "volt: {min: 0.1, max: 1.0}"}},
       "channels: steering: neutral, 0 V, is outside"},
      {{{"volt: {min: -1.8, max: 2.2}", "volt: {min: -1.8, max: .nan}"}},
       "translation/volt/max: must be finite"},
      {{{"ch: A", "ch: C"}}, "channels: two signals share a channel"},
      {{{"ch: A", "ch: A*"}}, "translation/ch: must not contain"},
      {{{"  steering:", "  streeing:"}}, "channels/steering: is missing"},
      {{{"ch: C", "ch: C\n    add_reference: true"}}, "reference/add_reference: is not a known key"}};
  for (const auto& [edits, part] : cases) {
    const std::string message = refusalOf("serial_ascii.yaml", edits);
    EXPECT_TRUE(has(message, part) && has(message, "device.yaml:")) << edits[0].second << ": " << message;
  }
}

TEST(DacSettings, AllSignalsMustBeInAFrameForAll) {
  const d::Edits all{{"frame: channel ", "frame: all "}, {"OK {ch}{code:04X}", "OK"}};
  d::Edits lacking = all;
  lacking.emplace_back("W{ch}{code:04X}", "S{reference.code} {translation.volt:.3f}");
  EXPECT_TRUE(has(refusalOf("serial_ascii.yaml", lacking), "write/send: lacks steering"));
  d::Edits narrow = all;
  narrow.emplace_back("W{ch}{code:04X}", "S{reference.code} {translation.volt:.3f} {steering.code:3d}");
  EXPECT_TRUE(has(refusalOf("serial_ascii.yaml", narrow), "steering: code 4095 does not fit"));
  d::Edits good = all;
  good.emplace_back("W{ch}{code:04X}", "S{reference.code} {translation.volt:.3f} {steering.code:4d}");
  EXPECT_EQ(refusalOf("serial_ascii.yaml", good), "");
}

TEST(DacSettings, RefusesWhatIsWrongInAnIioDevice) {
  const std::vector<std::pair<d::Edits, std::string>> cases{
      {{{"read_back: true", "read_back: 1"}}, "read_back: must be true or false"},
      {{{"index: 0", "index: -1"}}, "translation/index: must be at least 0"},
      {{{"index: 0", "index: 2"}}, "two signals share"},
      {{{"bits: 12", "bits: 0"}}, "bits: must be at least 1"},
      {{{"device: mcp4728", "device: \"\""}}, "device: must not be empty"},
      {{{"index: 0", "index: 0\n    code: {min: 0}"}}, "code: is not a known key"}};
  for (const auto& [edits, part] : cases) {
    const std::string message = refusalOf("mcp4728.yaml", edits);
    EXPECT_TRUE(has(message, part) && has(message, "device.yaml:")) << edits[0].second << ": " << message;
  }
}

}  // namespace test_dac_settings
