// SPDX-License-Identifier: BSD-3-Clause
// What may go wrong between a program and a serial D/A board. Commands 1 and 2 are the start, 3 to 5 the first voltages.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "dac_rig.h"
#include "steady.h"

namespace test_dac_faults {

namespace d = kurumaisu::dac;
using d::complaint;
using d::has;
using d::Rig;

namespace {

const d::Edits kNoRetry{{"retries: 1", "retries: 0"}};
const d::Edits kMute{{R"(expect: "OK {ch}{code:04X}")", R"(expect: "OK")"}, {"retries: 1", "retries: 0"}};
std::string faultOf(d::Converter& converter, const d::Volts& volts) {
  return complaint<d::Fault>([&] { converter.put(volts); });
}

double seconds(const std::function<void()>& action) {
  const auto start = std::chrono::steady_clock::now();
  action();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

TEST(DacFaults, NoReplyIsAFaultNamingPortAndSignal) {
  Rig rig(kNoRetry);
  const auto converter = rig.open();
  converter->put(d::kNeutral);
  rig.board.inject("silent@7");
  const std::string fault = faultOf(*converter, d::kMoving);
  EXPECT_TRUE(has(fault, "DAC_NO_REPLY") && has(fault, rig.folder / "port") && has(fault, "translation"))
      << fault;
}

TEST(DacFaults, OneMissingReplyIsMadeGoodByARetry) {
  Rig rig;
  const auto converter = rig.open();
  rig.board.inject("deaf@4");
  EXPECT_NEAR(converter->put(d::kMoving).translation, 0.5, 1e-3);
  EXPECT_NEAR(rig.board.volts().translation, 0.5, 1e-3);
  EXPECT_EQ(rig.board.commands(), 6U);
}

TEST(DacFaults, RetriesEnd) {
  Rig rig;
  const auto converter = rig.open();
  rig.board.inject("silent@4x9");
  EXPECT_TRUE(has(faultOf(*converter, d::kMoving), "DAC_NO_REPLY"));
  EXPECT_TRUE(rig.heardAll(6)) << "reference, translation twice, steering";
}

TEST(DacFaults, AWrongReplyIsAFaultThatShowsIt) {
  Rig rig(kNoRetry);
  const auto converter = rig.open();
  rig.board.inject("wrong@3");
  const std::string fault = faultOf(*converter, d::kNeutral);
  EXPECT_TRUE(has(fault, "DAC_WRONG_REPLY") && has(fault, "\"?\"") && has(fault, "OK C")) << fault;
}

TEST(DacFaults, HalfAReplyIsNone) {
  Rig rig(kNoRetry);
  const auto converter = rig.open();
  rig.board.inject("cut@3");
  EXPECT_TRUE(has(faultOf(*converter, d::kNeutral), "DAC_NO_REPLY"));
}

TEST(DacFaults, AllIsSentThoughTheReferenceFails) {
  Rig rig(kNoRetry);
  const auto converter = rig.open();
  converter->put(d::kMoving);
  rig.board.inject("silent@6x1");
  EXPECT_FALSE(faultOf(*converter, d::kNeutral).empty());
  ASSERT_TRUE(rig.heardAll(8));
  EXPECT_TRUE(rig.board.isNeutral(rig.board.volts()));
}

/// The board answers every command "OK". One that is answered late must not make the next one, which the board never
/// heard, look obeyed.
TEST(DacFaults, ALateReplyIsNotTakenForTheNextCommands) {
  d::Edits edits = d::kOneFrame;
  edits.push_back(kNoRetry[0]);
  Rig rig(edits);
  const auto converter = rig.open();
  converter->put(d::kNeutral);
  rig.board.inject("late@4=0.5");
  EXPECT_TRUE(has(faultOf(*converter, d::kMoving), "DAC_NO_REPLY"));
  rig.board.inject("deaf@5x6");
  EXPECT_TRUE(has(faultOf(*converter, d::kNeutral), "DAC_NO_REPLY"));
  EXPECT_FALSE(rig.board.isNeutral(rig.board.volts()));
}

TEST(DacFaults, ABurstWaitsForNoReplyBeforeTheChairIsStopped) {
  d::Rig rig(d::kBurst);
  const auto converter = rig.open();
  converter->put(d::kMoving);
  const std::size_t before = rig.board.history().size();
  rig.board.inject("late=0.3");  // of the reference's command
  const double begin = kurumaisu::steadyTime();
  converter->put(d::kNeutral);
  EXPECT_GE(kurumaisu::steadyTime() - begin, 0.3);
  const auto changes = rig.board.history();
  ASSERT_EQ(changes.size(), before + 2);
  EXPECT_TRUE(rig.board.isNeutral(changes.back().volts));
  EXPECT_LT(kurumaisu::seconds(changes.back().time) - begin, 0.3);
}

TEST(DacFaults, ABurstThatIsNotConfirmedIsRepeatedOneByOne) {
  d::Rig rig(d::kBurst);
  const auto converter = rig.open();
  converter->put(d::kMoving);
  const std::uint64_t before = rig.board.commands();
  for (const char* fault : {"silent", "wrong"}) {
    rig.board.inject(fault);
    EXPECT_EQ(converter->put(d::kNeutral).translation, 0) << fault;
  }
  EXPECT_GE(rig.board.commands(), before + 12);
}

TEST(DacFaults, AfterALateReplyAllIsWellAgain) {
  Rig rig(kMute);
  const auto converter = rig.open();
  rig.board.inject("late@5=0.5");
  EXPECT_FALSE(faultOf(*converter, d::kMoving).empty());
  EXPECT_NEAR(converter->put(d::kNeutral).translation, 0, 1e-3);
  EXPECT_TRUE(rig.board.isNeutral(rig.board.volts()));
}

/// Nobody knows whether a reply is still to come. What stops the chair goes out all the same, at once.
TEST(DacFaults, NeutralIsSentAtOnceWhereRepliesAreInDoubt) {
  Rig rig({kMute[0], kMute[1], {"late_reply: 0.8", "late_reply: 2.0"}});
  const auto converter = rig.open();
  converter->put(d::kMoving);
  rig.board.inject("silent@6x1");
  EXPECT_FALSE(faultOf(*converter, {0.6, -0.25, 2.5}).empty());
  const double time = seconds([&] {
    std::thread later([&] { converter->put(d::kNeutral); });
    EXPECT_TRUE(rig.board.wait([&] { return rig.board.isNeutral(rig.board.volts()); }, 1.5));
    later.join();
  });
  EXPECT_GT(time, 1.6) << "and the doubt was waited for";
  const d::Change last = rig.board.history().back();
  EXPECT_TRUE(rig.board.isNeutral(last.volts));
}

TEST(DacFaults, NeutralAfterAFaultWaitsForNoReply) {
  Rig rig;
  const auto converter = rig.open();
  converter->put(d::kMoving);
  rig.board.inject("silent@7x99");  // the reference is answered once more, V_f is not
  EXPECT_TRUE(has(faultOf(*converter, {0.6, -0.25, 2.5}), "translation"));
  std::thread later([&] { EXPECT_FALSE(faultOf(*converter, d::kNeutral).empty()); });
  EXPECT_TRUE(rig.board.wait([&] { return rig.board.isNeutral(rig.board.volts()); }, 0.3))
      << "less than reply_timeout";
  later.join();
}

TEST(DacFaults, ABoardThatReadsNothingIsAFaultAndNoHang) {
  const std::string padding(200, ' ');
  Rig rig({{R"("W{ch}{code:04X}")", "\"" + padding + R"(W{ch}{code:04X}")"},
           {"reply_timeout: 0.4", "reply_timeout: 0.05"},
           {"late_reply: 0.8", "late_reply: 0.05"}});
  const auto converter = rig.open();
  rig.board.inject("stall=60");
  std::string last;
  for (int i = 0; i < 20 && !has(last, "DAC_BLOCKED"); ++i) {
    EXPECT_LT(seconds([&] { last = faultOf(*converter, d::kMoving); }), 2);
    EXPECT_FALSE(last.empty());
  }
  EXPECT_TRUE(has(last, "DAC_BLOCKED")) << last;
}

TEST(DacFaults, UnpluggedAndBackUnderANewTerminal) {
  Rig rig;
  const auto converter = rig.open();
  converter->put(d::kMoving);
  const std::string before = std::filesystem::read_symlink(rig.folder / "port");
  rig.board.inject("unplug=0.1");
  const std::string fault = faultOf(*converter, d::kMoving);
  EXPECT_TRUE(has(fault, "DAC_CLOSED")) << fault;
  EXPECT_TRUE(has(faultOf(*converter, d::kNeutral), "opened again"));
  EXPECT_TRUE(has(complaint<d::Fault>([&] { converter->reopen(); }), "DAC_NO_PORT"));
  ASSERT_TRUE(rig.board.wait([&] { return std::filesystem::exists(rig.folder / "port"); }, d::kLong));
  converter->reopen();
  while (!converter->prepare()) continue;
  EXPECT_NE(std::filesystem::read_symlink(rig.folder / "port"), before);
  EXPECT_NEAR(rig.board.volts().translation, 0.5, 1e-3) << "opening moves nothing";
  converter->put(d::kNeutral);
  EXPECT_TRUE(rig.board.isNeutral(rig.board.volts()));
}

TEST(DacFaults, UnpluggedBetweenTwoFrames) {
  Rig rig;
  const auto converter = rig.open();
  rig.board.inject("unplug@4=60");
  EXPECT_TRUE(has(faultOf(*converter, d::kMoving), "DAC_CLOSED"));
}

TEST(DacFaults, TheReferenceIsLost) {
  Rig rig(kNoRetry);
  const auto converter = rig.open();
  converter->put(d::kNeutral);
  rig.board.inject("lost/reference@6x3");
  const std::string fault = faultOf(*converter, d::kMoving);
  EXPECT_TRUE(has(fault, "DAC_WRONG_REPLY") && has(fault, "reference")) << fault;
  ASSERT_TRUE(rig.heardAll(8)) << "the others are written all the same";
  EXPECT_EQ(rig.board.codes()[d::kReference], 0);
  EXPECT_GT(rig.board.codes()[d::kTranslation], 0);
}

TEST(DacFaults, AFaultOfOneSignalSparesTheOthers) {
  Rig rig(kNoRetry);
  const auto converter = rig.open();
  rig.board.inject("silent/steering@3x3");
  const std::string fault = faultOf(*converter, d::kMoving);
  EXPECT_TRUE(has(fault, "steering") && !has(fault, "translation of")) << fault;
  EXPECT_THROW(rig.board.inject("silent/brakes"), std::invalid_argument);
}

TEST(DacFaults, ABoardThatBootsWhenItIsOpenedIsAskedUntilItAnswers) {
  Rig rig(d::Edits{{"boot: 0.1", "boot: 10"}, {"reply_timeout: 0.4", "reply_timeout: 0.05"}});
  rig.board.inject("deaf@1x7");
  const auto converter = d::open(rig.device);
  int steps = 0;
  while (!converter->prepare()) ++steps;
  EXPECT_GE(steps, 3);  // of two questions each
  EXPECT_NEAR(converter->put(d::kMoving).translation, 0.5, 1e-3);
}

TEST(DacFaults, ABoardThatStaysDeafIsAFaultWhenItMustHaveBooted) {
  Rig rig(d::Edits{{"reply_timeout: 0.4", "reply_timeout: 0.05"}});
  rig.board.inject("deaf@1x1000");
  const std::string fault = complaint<d::Fault>([&] { rig.open(); });
  EXPECT_TRUE(has(fault, "DAC_NO_REPLY") && has(fault, "start of")) << fault;
}

TEST(DacFaults, ABoardThatSaysNothingGetsItsFirstVoltageWhenItMustHaveBooted) {
  Rig rig(d::Edits{{"boot: 0.1", "boot: 0.5"},
                   {"can_identify: true", "can_identify: false"},
                   {R"(expect: "ASCII-DAC *")", R"(expect: "")"}});
  const double begin = kurumaisu::steadyTime();
  const auto converter = d::open(rig.device);
  EXPECT_THROW(converter->put(d::kMoving), d::Fault) << "it is not prepared";
  while (!converter->prepare()) continue;
  EXPECT_GE(kurumaisu::steadyTime() - begin, 0.5);
}

TEST(DacFaults, ASecondOwnerIsRefused) {
  Rig rig;
  const auto converter = rig.open();
  const std::string fault = complaint<d::Fault>([&] { rig.open(); });
  EXPECT_TRUE(has(fault, "DAC_IN_USE") && has(fault, rig.folder / "port")) << fault;
  EXPECT_NEAR(converter->put(d::kMoving).translation, 0.5, 1e-3) << "the first goes on";
}

TEST(DacFaults, ThePortIsFreeAfterItsOwner) {
  Rig rig;
  rig.open().reset();
  EXPECT_NEAR(rig.open()->put(d::kMoving).translation, 0.5, 1e-3);
}

TEST(DacFaults, AnotherBoardIsRefused) {
  Rig rig;
  rig.device = rig.deviceOf({{"ASCII-DAC *", "DAC-9000 *"}});
  const std::string fault = complaint<d::Fault>([&] { rig.open(); });
  EXPECT_TRUE(has(fault, "DAC_WRONG_REPLY") && has(fault, "ASCII-DAC")) << fault;
  EXPECT_TRUE(rig.board.history().empty()) << "it got no voltage";
}

TEST(DacFaults, NoPort) {
  Rig rig;
  std::get<d::SerialSettings>(rig.device.back_end).port = rig.folder / "none";
  const std::string fault = complaint<d::Fault>([&] { rig.open(); });
  EXPECT_TRUE(has(fault, "DAC_NO_PORT") && has(fault, "none")) << fault;
}

TEST(DacFaults, NotANumberIsRefusedAndNothingIsSent) {
  Rig rig;
  const auto converter = rig.open();
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    EXPECT_THROW(converter->put({bad, 0, 2.5}), std::invalid_argument);
    EXPECT_THROW(converter->put({0, bad, 2.5}), std::invalid_argument);
    EXPECT_THROW(converter->put({0, 0, bad}), std::invalid_argument);
  }
  EXPECT_EQ(rig.board.commands(), 2U);
}

}  // namespace test_dac_faults
