// SPDX-License-Identifier: BSD-3-Clause
// The protocol, against the examples of its specification and of a real URG-04LX, written out.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "scip/code.h"
#include "scip/message.h"
#include "scip/request.h"
#include "scip/scan.h"
#include "scip/sensor.h"
#include "scip_frames.h"

namespace test_scip {

namespace s = kurumaisu::scip;

namespace {

const std::string kVersion =
    "VV\n00P\nVEND:Hokuyo Automatic Co.,Ltd.;[\nPROD:SOKUIKI Sensor URG-04LX;[\nFIRM:3.1.04(02/Aug./2007);a\n"
    "PROT:SCIP 2.0;N\nSERI:H0706400;F\n\n";
const std::string kState =
    "II\n00P\nMODL:URG-04LX(Hokuyo Automatic Co.,Ltd.);N\nLASR:OFF;7\nSCSP:Initial(600[rpm])<-Default "
    "setting by user;A\n"
    "MESM:IDLE;:\nSBPS:19200[bps]<-Default setting by user;A\nTIME:001957;O\nSTAT:Sensor works well.;8\n\n";
const std::string kParameters =
    "PP\n00P\nMODL:URG-04LX(Hokuyo Automatic Co.,Ltd.);N\nDMIN:20;4\nDMAX:5600;_\nARES:1024;\\\nAMIN:44;7\n"
    "AMAX:725;o\nAFRT:384;6\nSCAN:600;e\n\n";

s::Message messageOf(const std::string& bytes) {
  s::Assembler assembler;
  assembler.add(bytes, 0);
  const auto message = assembler.next();
  if (!message) throw std::runtime_error("no message in " + bytes);
  return *message;
}

/// The message that the action throws; empty if it throws none.
std::string complaint(const std::function<void()>& action) {
  try {
    action();
  } catch (const s::BadFrame& error) {
    return error.what();
  }
  return "";
}

/// PP's reply with other values; an empty one leaves its key out.
s::Message parametersWith(const std::map<std::string, std::string>& changes) {
  std::map<std::string, std::string> values = {{"MODL", "URG"},  {"DMIN", "20"}, {"DMAX", "5600"},
                                               {"ARES", "1024"}, {"AMIN", "44"}, {"AMAX", "725"},
                                               {"AFRT", "384"},  {"SCAN", "600"}};
  for (const auto& [key, value] : changes) values[key] = value;
  s::Message message{"PP", "00", {}, 0, 0};
  for (const auto& [key, value] : values) {
    if (!value.empty()) message.lines.push_back(std::string(key).append(":").append(value).append(";"));
  }
  return message;
}

}  // namespace

TEST(ScipCode, SumsOfTheSpecification) {
  const std::map<std::string, char> sums = {{"00", 'P'}, {"99", 'b'}, {"0E", 'e'}, {"10", 'Q'},
                                            {"02", 'R'}, {"03", 'S'}, {"50", 'U'}, {"98", 'a'}};
  for (const auto& [status, expected] : sums) EXPECT_EQ(s::sum(status), expected) << status;
}

TEST(ScipCode, NumbersOfTheSpecification) {
  EXPECT_EQ(s::encode(1234, 2), "CB");
  EXPECT_EQ(s::encode(5432, 3), "1Dh");
  EXPECT_EQ(s::encode(16000000, 4), "m2@0");
  EXPECT_EQ(s::decode("CB"), 1234U);
  EXPECT_EQ(s::decode("1Dh"), 5432U);
  EXPECT_EQ(s::decodeClock("m2@0"), 16000000U);
  EXPECT_EQ(s::encode(4095, 2), "oo");
  EXPECT_THROW(s::encode(4096, 2), std::out_of_range);
  EXPECT_EQ(s::decode("ooo"), 262143U);
  EXPECT_THROW(s::decodeClock("m2@"), s::BadFrame);
  EXPECT_THROW(s::decodeClock("m2@00"), s::BadFrame);
}

TEST(ScipCode, OnlyTheAlphabetIsANumber) {
  for (int byte = 0; byte < 256; ++byte) {
    const std::string text = std::string("0") + static_cast<char>(byte) + "0";
    if (byte >= 0x30 && byte <= 0x6f) {
      EXPECT_EQ(s::decode(text), 64U * static_cast<unsigned>(byte - 0x30));
    } else {
      EXPECT_THROW(s::decode(text), s::BadFrame) << byte;
    }
  }
}

TEST(ScipRequest, WrittenAndReadAgain) {
  const s::Request stream{true, s::Form::kDistance, 44, 725, 1, 0, 0};
  EXPECT_EQ(s::command(stream), "MD0044072501000");
  EXPECT_EQ(s::beams(stream), 682);
  const s::Request once{false, s::Form::kIntensity, 0, 768, 99, 0, 0};
  EXPECT_EQ(s::command(once), "GE0000076899");
  EXPECT_EQ(s::beams(once), 8);
  for (const char* command :
       {"MD0044072501000", "MS0000000001912", "ME9999999999999", "GD0046072201", "GS0000000099"})
    EXPECT_EQ(s::command(s::request(command).value()), command);
  EXPECT_EQ(s::request("GD0000076800").value().cluster, 1);  // 0 joins none
  for (const char* command : {"", "MD", "MD004407250100", "MD00440725010000", "MX0044072501000",
                              "GD0044072501000", "MD0044072501", "MD00440725 1000", "md0044072501000"})
    EXPECT_FALSE(s::request(command)) << command;
}

TEST(ScipRequest, AStreamCountsDown) {
  const s::Request asked{true, s::Form::kDistance, 44, 725, 1, 0, 10};
  EXPECT_TRUE(s::answers("MD0044072501009", asked));
  EXPECT_FALSE(s::answers("MD0044072501109", asked));
  EXPECT_FALSE(s::answers("MD0044072502009", asked));
  EXPECT_FALSE(s::answers("GD0044072501", asked));
}

TEST(ScipSensor, ARealSensorsWords) {
  for (const std::string& bytes : {kVersion, kState, kParameters})
    EXPECT_EQ(messageOf(bytes).bad_sums, 0) << bytes;
  EXPECT_EQ(s::keyed(messageOf(kVersion)).at("SERI"), "H0706400");
  EXPECT_EQ(s::keyed(messageOf(kState)).at("SCSP"), "Initial(600[rpm])<-Default setting by user");
  const s::Parameters p = s::parameters(messageOf(kParameters));
  EXPECT_EQ(p.model, "URG-04LX(Hokuyo Automatic Co.,Ltd.)");
  EXPECT_EQ(p.distance_min, 20);
  EXPECT_EQ(p.distance_max, 5600);
  EXPECT_NEAR(p.bearing(p.first) * 180 / M_PI, -119.531, 5e-4);
  EXPECT_NEAR(p.bearing(p.last) * 180 / M_PI, 119.883, 5e-4);
  EXPECT_NEAR(p.stepTime(), 97.66e-6, 5e-9);
  EXPECT_NEAR(p.first * p.stepTime(), 4.30e-3, 5e-6);
  EXPECT_EQ(p.scanTime(), 0.1);
}

TEST(ScipSensor, AWrongSumIsCountedAndTheRestRead) {
  std::string bytes = kVersion;
  bytes.replace(bytes.find(";F\n"), 3, ";G\nextra\n");
  const s::Message message = messageOf(bytes);
  EXPECT_EQ(message.bad_sums, 2);
  EXPECT_EQ(s::keyed(message).at("SERI"), "H0706400");
  EXPECT_EQ(s::keyed(message).at("FIRM"), "3.1.04(02/Aug./2007)");
}

TEST(ScipSensor, EveryParameterMissingOrAbsurd) {
  EXPECT_EQ(s::parameters(parametersWith({})).last, 725);
  for (const std::string key : {"MODL", "DMIN", "DMAX", "ARES", "AMIN", "AMAX", "AFRT", "SCAN"}) {
    EXPECT_EQ(complaint([&] { s::parameters(parametersWith({{key, ""}})); }), "PP: " + key + " is missing");
    if (key == "MODL") continue;
    for (const char* value :
         {"-1", "x", "5x", " 5", "+5", "5.0", "0x5", ";", "999999", "2147483647", "99999999999"}) {
      const s::Message message = parametersWith({{key, value}});
      EXPECT_NE(complaint([&] { s::parameters(message); }).find(key), std::string::npos) << key << value;
    }
  }
  for (const char* key : {"DMAX", "ARES", "SCAN"})
    EXPECT_NE(complaint([&] { s::parameters(parametersWith({{key, "0"}})); }), "") << key;
}

TEST(ScipSensor, ParametersThatContradictEachOther) {
  const std::vector<std::pair<std::map<std::string, std::string>, std::string>> cases = {
      {{{"AMIN", "726"}}, "AMIN 726 is above AMAX 725"},
      {{{"AMIN", "0"}, {"ARES", "725"}, {"AFRT", "0"}}, "AMIN to AMAX are more than the 725 steps"},
      {{{"AFRT", "1025"}}, "AFRT 1025"},
      {{{"DMIN", "5600"}}, "DMIN"},
      {{{"AMIN", "9000"}, {"AMAX", "10000"}, {"ARES", "10000"}},
       "AMAX"},                        // no command has five digits for a step
      {{{"DMAX", "262144"}}, "DMAX"},  // no three characters say it
  };
  for (const auto& [changes, word] : cases) {
    const s::Message message = parametersWith(changes);
    EXPECT_NE(complaint([&] { s::parameters(message); }).find(word), std::string::npos) << word;
  }
  EXPECT_EQ(s::parameters(parametersWith({{"AMIN", "0"}, {"AMAX", "1023"}})).last, 1023);
}

}  // namespace test_scip
