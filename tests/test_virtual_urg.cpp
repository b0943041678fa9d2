// SPDX-License-Identifier: BSD-3-Clause
// The virtual sensor against the examples and tables of SCIP 2.0 (Hokuyo C-42-03320B) and what clients ask.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "scip/scan.h"
#include "virtual_sensor.h"
#include "virtual_urg/frames.h"

namespace test_virtual_urg {

namespace s = kurumaisu::scip;
namespace v = kurumaisu::virtual_urg;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A URG-04LX that speaks SCIP 2.0 already.
struct Urg : v::Sensor {
  explicit Urg(const std::vector<std::string>& faults = {}, const v::Clock& clock = {})
      : Sensor("urg_04lx", faults, clock) {
    ask("SCIP2.0");
  }
};

std::vector<s::Message> messages(const std::string& bytes) {
  s::Assembler assembler;
  assembler.add(bytes, 0);
  std::vector<s::Message> all;
  while (auto message = assembler.next()) all.push_back(*message);
  EXPECT_EQ(assembler.counts().bad_sums + assembler.counts().unreadable + assembler.counts().stray_bytes, 0U);
  return all;
}

s::Rotation decoded(const std::string& bytes, const std::string& command) {
  return s::decodeScan(messages(bytes).at(0), s::request(command).value());
}

}  // namespace

TEST(VirtualUrg, SumsAreThoseOfRealVersionLines) {
  // Another unit's than the recorded one: urgnetwork's wiki.
  EXPECT_EQ(v::keyedLine("VEND", "Hokuyo Automatic Co.,Ltd."), "VEND:Hokuyo Automatic Co.,Ltd.;[\n");
  EXPECT_EQ(v::keyedLine("FIRM", "3.1.00(18/Jan./2007)"), "FIRM:3.1.00(18/Jan./2007);`\n");
  EXPECT_EQ(v::keyedLine("SERI", "H0614967"), "SERI:H0614967;V\n");
  EXPECT_EQ(v::keyedLine("TIME", "081615"), "TIME:081615;N\n");
}

TEST(VirtualUrg, WakesInScip11AndSwitchesOnce) {
  v::Sensor urg("urg_04lx");
  EXPECT_EQ(urg.ask("QT"), "QT\nE\n\n");
  EXPECT_EQ(urg.ask("SCIP2.0"), "SCIP2.0\n0\n\n");
  EXPECT_EQ(urg.ask("SCIP2.0"), "SCIP2.0\n0Ee\n\n");
  EXPECT_EQ(urg.ask("QT"), "QT\n00P\n\n");
  EXPECT_EQ(v::Sensor("utm_30lx").ask("QT"), "QT\n00P\n\n");
}

TEST(VirtualUrg, TakesAnyEndOfLineAndEchoesStrings) {
  Urg urg;
  EXPECT_EQ(urg.device.receive("QT\r\n\r\nBM;a b_.+@9\rTM", 0).bytes, "QT\n00P\n\nBM;a b_.+@9\n00P\n\n");
  EXPECT_EQ(urg.device.receive("0\n", 0).bytes, "TM0\n00P\n\n");
  EXPECT_EQ(urg.status("QT;0123456789abcdef"), "00");
  EXPECT_EQ(urg.status("QT;0123456789abcdefg"), "0G");
  EXPECT_EQ(urg.status("QT;what?"), "0H");
}

TEST(VirtualUrg, RefusesAsTheTablesSay) {
  Urg urg;
  for (const auto& [line, status] :
       std::vector<std::pair<std::string, std::string>>{{"XX", "0E"},
                                                        {"V", "0E"},
                                                        {"MD", "0C"},
                                                        {"MD00440725000000", "0E"},
                                                        {"MDx044072501000", "01"},
                                                        {"MD0044 72501000", "02"},
                                                        {"MD00440725-1000", "03"},
                                                        {"MD0044076901000", "04"},
                                                        {"MD0725004401000", "05"},
                                                        {"MD0044072501x00", "06"},
                                                        {"MD00440725010 0", "07"},
                                                        {"GD0044072501", "10"},
                                                        {"TM1", "04"},
                                                        {"TM2", "03"},
                                                        {"TM3", "01"},
                                                        {"SS115201", "02"},
                                                        {"SS019200", "03"},
                                                        {"SSfast!!", "01"},
                                                        {"SS038400", "02"},
                                                        {"CR00", "03"},
                                                        {"CR11", "02"},
                                                        {"CRx1", "01"},
                                                        {"HS0", "0C"},
                                                        {"ME0044072501000", "0E"},
                                                        {"ND0044072501000", "0E"},
                                                        {"DL00", "0E"},
                                                        {"\x02"
                                                         "AR00\xff",
                                                         "0E"}})
    EXPECT_EQ(urg.status(line), status) << line;
  EXPECT_FALSE(urg.device.wantsScan());
}

TEST(VirtualUrg, AnswersAsManyCommandsAsAnyClientSends) {
  v::Sensor utm("utm_30lx");
  for (int i = 0; i < 9; ++i) {
    EXPECT_EQ(messages(utm.ask("VV")).at(0).lines.size(), 5U);
    EXPECT_EQ(messages(utm.ask("II")).at(0).lines.size(), 7U);
    EXPECT_EQ(messages(utm.ask("PP")).at(0).lines.size(), 8U);
  }
  EXPECT_EQ(utm.status("ME0000108001001"), "00");
  EXPECT_EQ(utm.status("CR01"), "04");
  EXPECT_EQ(utm.status("HS1"), "03");
  const s::Parameters parameters = v::parametersOf(utm.device.model().parameters);
  EXPECT_EQ(parameters.last - parameters.first + 1, 1081);
  EXPECT_DOUBLE_EQ(utm.device.scanTime(), 0.025);
}

TEST(VirtualUrg, AnswersOnlyOneOfAKindThatComeAtOnce) {
  Urg urg;
  EXPECT_EQ(urg.device.receive("BM\nQT\nBM\n", 0).bytes, "BM\n00P\n\nQT\n00P\n\nBM\n0Bb\n\n");
  EXPECT_EQ(urg.ask("BM"), "BM\n00P\n\n");
  EXPECT_EQ(urg.ask("BM"), "BM\n02R\n\n");
}

TEST(VirtualUrg, EncodesTheSpecificationsExamples) {
  Urg urg({"t0=16000000"});
  urg.ask("MD0100010001001");
  EXPECT_EQ(urg.turn(5.432).bytes, "MD0100010001000\n99b\nm2@0?\n1DhM\n\n");
  urg.now = 0;
  urg.ask("MS0100010001001;x");
  EXPECT_EQ(urg.turn(1.234).bytes, "MS0100010001000;x\n99b\nm2@0?\nCB5\n\n");
}

TEST(VirtualUrg, AFullScanIs2137BytesIn32Lines) {
  Urg urg;
  EXPECT_EQ(urg.ask("MD0044072501000"), "MD0044072501000\n00P\n\n");
  const std::string bytes = urg.turn(5.432).bytes;
  EXPECT_EQ(bytes.size(), 2137U);
  const std::vector<std::string> lines = messages(bytes).at(0).lines;
  ASSERT_EQ(lines.size(), 33U);
  EXPECT_EQ(lines[31].size(), 64U);
  EXPECT_EQ(lines[32].size(), 62U);
  EXPECT_EQ(lines[1].substr(60), "1Dh1");  // the value goes on in the next line
  EXPECT_EQ(lines[2].substr(0, 5), "Dh1Dh");
}

TEST(VirtualUrg, AStreamCountsDownAndThenTheLaserIsOff) {
  Urg urg;
  urg.ask("MD0044072501102;go");
  EXPECT_EQ(urg.turn().bytes.substr(0, 19), "MD0044072501101;go\n");
  EXPECT_EQ(urg.turn().bytes, "");  // interval 1
  EXPECT_EQ(urg.turn().bytes.substr(0, 19), "MD0044072501100;go\n");
  EXPECT_FALSE(urg.device.wantsScan());
  EXPECT_EQ(urg.status("GD0044072501"), "10");
  urg.ask("MD0044072500000");
  for (int i = 0; i < 150; ++i) EXPECT_EQ(urg.turn().bytes.substr(0, 20), "MD0044072500000\n99b\n");
  EXPECT_EQ(urg.status("BM"), "02");
  urg.ask("QT");
  EXPECT_EQ(urg.turn().bytes, "");
}

TEST(VirtualUrg, ASingleScanWaitsForTheTurnAndOthersWaitForIt) {
  Urg urg;
  urg.ask("BM");
  EXPECT_EQ(urg.device.receive("GS0100010001\nVV\n", 0).bytes, "");
  const std::string bytes = urg.turn(1.234).bytes;
  EXPECT_EQ(bytes.substr(0, 27), "GS0100010001\n00P\n00000\nCB5\n");
  EXPECT_EQ(messages(bytes).at(1).command, "VV");
  EXPECT_EQ(urg.ask("GS0100010001"), "");
  EXPECT_EQ(urg.ask("QT"), "QT\n00P\n\n");
  EXPECT_EQ(urg.turn().bytes, "");
}

TEST(VirtualUrg, AClusterIsItsLeastDistanceThatIsNoCode) {
  v::Sensor utm("utm_30lx");
  v::Measurement turn;
  turn.codes.assign(1081, 3000);
  turn.intensities.assign(1081, 1);
  turn.codes[500] = 1;
  turn.codes[501] = 2000, turn.intensities[501] = 77;
  for (const int step : {503, 504, 505}) turn.codes[step] = 3;
  const std::string command = "ME0500050703001";
  utm.ask(command);
  const s::Rotation scan = decoded(utm.device.measure(turn, 0).bytes, "ME0500050703000");
  EXPECT_EQ(scan.distances, (std::vector<int>{2000, 3, 3000}));
  EXPECT_EQ(scan.intensities, (std::vector<int>{77, 1, 1}));
}

TEST(VirtualUrg, WhatHasNoDistanceIsACode) {
  Urg urg;
  std::vector<double> ranges(682, 1.0);
  const std::vector<double> some{kNan, kInfinity, 0.0, -kInfinity, 0.0194, 0.0196, 5.6, 5.601, 4.1};
  std::copy(some.begin(), some.end(), ranges.begin());
  urg.ask("MD0042005201001");
  EXPECT_EQ(decoded(urg.turn(ranges).bytes, "MD0042005201000").distances,
            (std::vector<int>{19, 19, 7, 0, 7, 7, 7, 20, 5600, 0, 4100}));
  urg.ask("MS0052005201001");  // two characters end at 4095
  EXPECT_EQ(decoded(urg.turn(ranges).bytes, "MS0052005201000").distances, std::vector<int>{4095});
}

TEST(VirtualUrg, TellsItsTimeInAdjustModeAndNothingElse) {
  Urg urg({}, {16777200, 1.25e-3});
  urg.ask("MD0044072501000");
  EXPECT_EQ(urg.ask("TM0"), "TM0\n00P\n\n");
  EXPECT_EQ(urg.status("TM0"), "02");
  EXPECT_EQ(urg.turn().bytes, "");
  EXPECT_EQ(urg.status("MD0044072501000"), "0A");
  EXPECT_EQ(urg.status("QT"), "00");
  urg.now = 8;  // 16777200 + 8010 - 2^24
  EXPECT_EQ(s::decodeClock(messages(urg.ask("TM1")).at(0).lines.at(0)), 7994U);
  EXPECT_EQ(urg.status("TM2"), "00");
  EXPECT_EQ(urg.status("BM"), "00");
  EXPECT_EQ(urg.status("RS"), "00");
  EXPECT_EQ(urg.device.clock(9), 1001U);
}

TEST(VirtualUrg, RateSpeedAndSensitivityAreKeptUntilReset) {
  Urg urg;
  EXPECT_EQ(urg.device.baud(), 19200);
  EXPECT_EQ(urg.status("SS115200"), "00");
  EXPECT_EQ(urg.device.baud(), 115200);
  EXPECT_EQ(urg.status("CR10"), "00");
  EXPECT_DOUBLE_EQ(urg.device.scanTime(), 60.0 / 540);
  const std::string state = urg.ask("II");
  EXPECT_NE(state.find("SBPS:115200[bps]"), std::string::npos);
  EXPECT_NE(state.find("(540[rpm])"), std::string::npos);
  EXPECT_EQ(urg.status("CR99"), "00");
  urg.ask("CR05");
  urg.ask("RS");
  EXPECT_EQ(urg.device.baud(), 19200);
  EXPECT_DOUBLE_EQ(urg.device.scanTime(), 0.1);
  v::Sensor ug01("urg_04lx_ug01");
  EXPECT_EQ(ug01.status("HS0"), "02");
  EXPECT_EQ(ug01.status("HS1"), "00");
  EXPECT_EQ(ug01.status("SS115200"), "04");
}

TEST(VirtualUrg, PowerForgetsAll) {
  Urg urg;
  urg.ask("SS115200");
  urg.ask("MD0044072501000");
  urg.device.powerCycle(5);
  urg.now = 5.5;  // boots
  EXPECT_EQ(urg.ask("QT"), "");
  EXPECT_EQ(urg.device.counts().lost_input, 3U);
  urg.now = 6.25;
  EXPECT_EQ(urg.ask("QT"), "QT\nE\n\n");
  EXPECT_EQ(urg.device.baud(), 19200);
  EXPECT_EQ(urg.device.clock(6.25), 1250U);
}

TEST(VirtualUrg, PretendsMalfunction) {
  v::Sensor urg("urg_04lx_ug01");
  EXPECT_EQ(urg.status("DB10"), "03");
  EXPECT_EQ(urg.status("DB06"), "01");
  EXPECT_EQ(urg.status("DB02"), "00");
  EXPECT_EQ(urg.status("DB02"), "02");
  EXPECT_EQ(urg.status("BM"), "01");
  EXPECT_EQ(urg.status("MD0044072501000"), "50");
  EXPECT_NE(urg.ask("II").find("malfunction"), std::string::npos);
  EXPECT_EQ(urg.status("DB10"), "00");
  for (const auto& [play, statuses] :
       std::vector<std::pair<std::string, std::vector<std::string>>>{{"DB03", {"99", "21", "98", "99"}},
                                                                     {"DB04", {"99", "21", "50", ""}},
                                                                     {"DB05", {"99", "50", "", ""}}}) {
    urg.ask("RS");
    EXPECT_EQ(urg.status(play), "00");
    urg.ask("MD0044072501000");
    for (int i = 0; i < 19; ++i) urg.turn();
    for (const std::string& status : statuses) {
      const std::string bytes = urg.turn().bytes;
      EXPECT_EQ(bytes.empty() ? "" : bytes.substr(16, 2), status) << play;
    }
  }
}

TEST(VirtualUrg, RefusesAModelThatContradictsItself) {
  const auto fails = [](auto change, const std::string& key) {
    v::Model model = v::shipped("urg_04lx");
    change(model);
    try {
      const v::Device device(model, {}, {}, 0);
      ADD_FAILURE() << key;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(key), std::string::npos) << error.what();
    }
  };
  fails([](v::Model& m) { m.end_step = 700; }, "end_step");
  fails([](v::Model& m) { m.parameters.erase(m.parameters.begin() + 3); }, "ARES");
  fails([](v::Model& m) { m.protocol = 3; }, "protocol");
  fails([](v::Model& m) { m.baud = 38400; }, "baud");
  fails([](v::Model& m) { m.refused["MEX"] = "0E"; }, "MEX");
  fails([](v::Model& m) { m.boot_time = -1; }, "boot_time");
  Urg urg;
  urg.ask("MD0044072501000");
  EXPECT_THROW(urg.turn(std::vector<double>(681)), std::invalid_argument);
}

TEST(VirtualUrg, SurvivesAnEndlessLine) {
  Urg urg;
  const std::string chunk(1 << 16, 'M');
  for (int i = 0; i < 256; ++i) EXPECT_EQ(urg.device.receive(chunk, 0).bytes, "");
  EXPECT_EQ(urg.device.counts().lost_input, (256U << 16U) - 129U);
  EXPECT_EQ(urg.ask(""), chunk.substr(0, 128) + "\n0Bb\n\n");
  EXPECT_EQ(urg.ask("QT"), "QT\n00P\n\n");
}

TEST(VirtualUrg, SurvivesAnyBytesAndAnswersNoMoreThanItHears) {
  constexpr std::size_t kFullReplies = 5100;  // [bytes] 17 commands
  std::mt19937 random(1);
  Urg urg;
  const std::string words = "MGDSE0472;\n\r\n\nVPIQTBRCHx\xff ";
  for (int i = 0; i < 20000; ++i) {
    std::string bytes;
    for (std::size_t k = random() % 300; k > 0; --k) bytes += words[random() % words.size()];
    bytes += i % 3 == 0 ? "\nBM\nMD0044072501100\nGS0000076800\nQT;x\n" : "";
    ASSERT_LE(urg.device.receive(bytes, i).bytes.size(), kFullReplies + 8 * bytes.size());
    ASSERT_LE(urg.turn().bytes.size(), 3000U + kFullReplies);
    urg.now = i;
  }
  urg.device.disconnect(urg.now);
  EXPECT_EQ(urg.ask("RS"), "RS\n00P\n\n");
}

}  // namespace test_virtual_urg
