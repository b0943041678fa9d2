// SPDX-License-Identifier: BSD-3-Clause
// Each fault of the virtual sensor: the very bytes it changes, or the event that it makes.
#include <gtest/gtest.h>

#include <stdexcept>

#include "virtual_sensor.h"

namespace test_virtual_urg_faults {

namespace v = kurumaisu::virtual_urg;

namespace {

const std::string kAsk = "MS0100010101000";
const std::string kScan = kAsk + "\n99b\n00000\n0`0`P\n\n";  // 48 mm, twice

/// A URG-04LX that streams two beams of 48 mm; its clock stands, so that all scans have the same bytes.
struct Stream : v::Sensor {
  explicit Stream(const std::vector<std::string>& faults) : Sensor("urg_04lx", faults, {0, -1}) {
    ask("SCIP2.0");
    ask(kAsk);
  }

  v::Output scan() { return turn(0.048); }

  /// The scans before the fault are whole; the one that it strikes.
  v::Output struck(int number) {
    for (int i = 1; i < number; ++i) EXPECT_EQ(scan().bytes, kScan) << i;
    return scan();
  }
};

std::string whyNot(const std::string& text) {
  try {
    v::fault(text);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST(VirtualUrgFaults, NamesAreRead) {
  const v::Fault fault = v::fault("dribble@12=0.5");
  EXPECT_EQ(fault.name, "dribble");
  EXPECT_EQ(fault.scan, 12);
  EXPECT_EQ(fault.value, 0.5);
  EXPECT_FALSE(v::fault("dup").scan);
  for (const char* wrong : {"", "corupt", "err", "err00", "err99", "err5", "err5x", "@3", "=1"})
    EXPECT_NE(whyNot(wrong).find("There are"), std::string::npos) << wrong;
  for (const char* wrong : {"t0", "t0@3=1", "t0=", "t0=1x", "t0=-1", "t0=inf", "corrupt@", "corrupt@0",
                            "corrupt@x", "corrupt=1", "bm01@3", "corrupt@5@6"})
    EXPECT_NE(whyNot(wrong).find("fault " + std::string(wrong) + ": "), std::string::npos) << wrong;
  for (const char* name : {"corrupt", "blackhole", "close-on-accept", "errNN", "vv-badsum"})
    EXPECT_NE(v::faultHelp().find(name), std::string::npos) << name;
}

TEST(VirtualUrgFaults, WithoutAnyTheScanIsWhole) { EXPECT_EQ(Stream({}).struck(9).bytes, kScan); }

TEST(VirtualUrgFaults, DamageToTheBytes) {
  const std::string half = kScan.substr(0, kScan.size() / 2);
  const std::string noise("\0\xff~MD\r99b\x7f\x80;\0\xff~MD\r99b\x7f\x80;", 24);
  const std::string head = kAsk + "\n99b\n00000\n";
  for (const auto& [fault, bytes] :
       std::vector<std::pair<std::string, std::string>>{{"corrupt@5", head + "1`0`P\n\n"},
                                                        {"trunc@5", half},
                                                        {"noend@5", kScan.substr(0, kScan.size() - 2)},
                                                        {"badlf@5", kAsk + "\n99bx00000\n0`0`P\n\n"},
                                                        {"garbage@5", noise + kScan},
                                                        {"garbage@5=3", noise.substr(0, 3) + kScan},
                                                        {"dup@5", kScan + kScan},
                                                        {"err50@5", kAsk + "\n50U\n\n"},
                                                        {"err98@5", kAsk + "\n98a\n\n"},
                                                        {"zeros@5", head + "00000\n\n"},
                                                        {"codes@5", head + "00011\n\n"}}) {
    Stream stream({fault});
    EXPECT_EQ(stream.struck(5).bytes, bytes) << fault;
    EXPECT_EQ(stream.scan().bytes, kScan) << fault;
  }
}

TEST(VirtualUrgFaults, TheyStrikeTheFirstScanOrAll) {
  EXPECT_EQ(Stream({"badlf@1"}).scan().bytes[19], 'x');
  Stream stream({"err50@2=2", "dup"});
  stream.scan();
  EXPECT_EQ(stream.scan().bytes, kAsk + "\n50U\n\n" + kAsk + "\n50U\n\n");
  EXPECT_NE(stream.ask("II").find("STAT:Sensor malfunction."), std::string::npos);
  EXPECT_EQ(stream.scan().bytes.substr(16, 2), "50");
  EXPECT_EQ(stream.scan().bytes, kScan + kScan);
  EXPECT_NE(stream.ask("II").find("STAT:Sensor works well."), std::string::npos);
}

TEST(VirtualUrgFaults, EventsOfTheConnection) {
  for (const auto& [fault, event] : std::vector<std::pair<std::string, v::Event>>{
           {"close@3", v::Event::kClose}, {"rst@3", v::Event::kReset}, {"hangup@3=0.5", v::Event::kHangUp}}) {
    Stream stream({fault});
    EXPECT_EQ(stream.struck(2).event, v::Event::kNone) << fault;
    const v::Output output = stream.scan();
    EXPECT_EQ(output.bytes, kScan) << fault;
    EXPECT_EQ(output.event, event) << fault;
    EXPECT_EQ(output.away, event == v::Event::kHangUp ? 0.5 : 0.0) << fault;
    EXPECT_EQ(stream.device.wantsScan(), event != v::Event::kHangUp) << fault;  // unplugged, it forgets
  }
}

TEST(VirtualUrgFaults, ResetBetweenCommands) {
  v::Sensor urg("urg_04lx", {"rst-after-cmd@2"});
  EXPECT_EQ(urg.device.receive("SCIP2.0\n", 0).event, v::Event::kNone);
  const v::Output output = urg.device.receive("QT\nVV\n", 0);
  EXPECT_EQ(output.event, v::Event::kReset);
  EXPECT_EQ(output.bytes, "QT\n00P\n\n");
  EXPECT_EQ(urg.device.receive("VV\n", 0).event, v::Event::kNone);
}

TEST(VirtualUrgFaults, ClosesOnAccept) {
  v::Sensor urg("urg_04lx", {"close-on-accept=2"});
  EXPECT_EQ(urg.device.connect(0).event, v::Event::kClose);
  EXPECT_EQ(urg.device.connect(0).event, v::Event::kClose);
  EXPECT_EQ(urg.device.connect(0).event, v::Event::kNone);
  v::Sensor always("urg_04lx", {"close-on-accept"});
  for (int i = 0; i < 9; ++i) EXPECT_EQ(always.device.connect(0).event, v::Event::kClose);
}

TEST(VirtualUrgFaults, StallIsSilence) {
  Stream stream({"stall@3"});
  EXPECT_EQ(stream.struck(3).bytes, "");
  EXPECT_EQ(stream.scan().bytes, "");
  EXPECT_EQ(stream.ask(kAsk), kAsk + "\n00P\n\n");
  EXPECT_EQ(stream.scan().bytes, kScan);
  Stream deaf({"stall@3=0.75"});
  EXPECT_EQ(deaf.struck(3).bytes, "");
  EXPECT_EQ(deaf.ask("QT"), "");
  deaf.now += 0.75;
  EXPECT_EQ(deaf.scan().bytes, kScan);
}

TEST(VirtualUrgFaults, RebootForgetsAllAndItsClock) {
  v::Sensor urg("utm_30lx", {"reboot@2=0.5", "scip1", "t0=16774716"});
  EXPECT_EQ(urg.ask("QT"), "QT\nE\n\n");
  urg.ask("SCIP2.0");
  urg.ask("MD0000000001000");
  EXPECT_EQ(urg.turn().bytes.substr(20, 4), "ooHl");  // 16774716 in characters of six bits
  EXPECT_NE(urg.turn().bytes, "");
  EXPECT_EQ(urg.turn().bytes, "");
  EXPECT_EQ(urg.ask("QT"), "");
  urg.now = 1;
  EXPECT_EQ(urg.ask("QT"), "QT\nE\n\n");
  EXPECT_LT(urg.device.clock(1), 1000U);
}

TEST(VirtualUrgFaults, TheClockWraps) {
  v::Sensor urg("utm_30lx", {"t0=16774716"});
  EXPECT_EQ(urg.device.clock(0), 16774716U);
  EXPECT_EQ(urg.device.clock(2.499), 16777215U);
  EXPECT_EQ(urg.device.clock(2.5), 0U);
}

TEST(VirtualUrgFaults, Refusals) {
  Stream stream({"bm01", "md0e"});
  EXPECT_EQ(stream.ask("BM"), "BM\n01Q\n\n");
  EXPECT_EQ(stream.ask(kAsk), kAsk + "\n0Ee\n\n");
  v::Sensor utm("utm_30lx", {"no-me"});
  EXPECT_EQ(utm.ask("ME0000108001000"), "ME0000108001000\n0Ee\n\n");
  EXPECT_EQ(utm.status("MD0000108001000"), "00");
}

TEST(VirtualUrgFaults, WrongWordsOfItself) {
  Stream stream({"vv-badsum", "pp-ares0", "pp-crossed"});
  EXPECT_NE(stream.ask("VV").find("SERI:H0000000;6\n"), std::string::npos);
  const std::string parameters = stream.ask("PP");
  EXPECT_NE(parameters.find("ARES:0;"), std::string::npos);
  EXPECT_NE(parameters.find("AMIN:725;"), std::string::npos);
  EXPECT_NE(parameters.find("AMAX:44;"), std::string::npos);
  EXPECT_EQ(stream.scan().bytes, kScan);
}

TEST(VirtualUrgFaults, WhatTheServerDoes) {
  Stream stream({"dribble@2", "dribble@3=0.02", "strict-baud"});
  EXPECT_EQ(stream.scan().spread, 0);
  EXPECT_DOUBLE_EQ(stream.scan().spread, 0.08);
  EXPECT_DOUBLE_EQ(stream.scan().spread, 0.02);
  EXPECT_TRUE(stream.device.hasStrictBaud());
  v::Sensor hole("urg_04lx", {"blackhole"});
  EXPECT_TRUE(hole.device.isBlackHole());
  EXPECT_EQ(hole.ask("SCIP2.0"), "");
  EXPECT_EQ(hole.device.counts().lost_input, 8U);
}

}  // namespace test_virtual_urg_faults
