// SPDX-License-Identifier: BSD-3-Clause
// The serial back end and the virtual board, each by the other's word.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "dac_rig.h"

namespace test_dac_serial {

namespace d = kurumaisu::dac;
using d::Rig;

namespace {

bool isWithin(double volt, const d::Band& band) { return band.min - 1e-9 <= volt && volt <= band.max + 1e-9; }

void expectSame(const d::Volts& held, const d::Volts& board) {
  EXPECT_DOUBLE_EQ(held.translation, board.translation);
  EXPECT_DOUBLE_EQ(held.steering, board.steering);
  EXPECT_DOUBLE_EQ(held.reference, board.reference);
}

/// As the guard does: neutral after a fault, the port anew where it is lost.
void recover(d::Converter& converter) {
  try {
    converter.put(d::kNeutral);
  } catch (const d::Fault&) {
    try {
      converter.reopen();
      while (!converter.prepare()) continue;
    } catch (const d::Fault&) {
    }
  }
}

/// Whenever put() returns, the board holds what it says, whatever goes wrong before or meanwhile. A burst rides through most.
void rideThroughFaults(const d::Edits& edits, unsigned seed, int least_faults) {
  std::mt19937 random(seed);
  d::Edits all = edits;
  all.insert(all.end(),
             {{"reply_timeout: 0.4", "reply_timeout: 0.1"}, {"late_reply: 0.8", "late_reply: 0.4"}});
  Rig rig(all);
  std::unique_ptr<d::Converter> converter;
  ASSERT_TRUE(rig.board.wait(
      [&] {
        d::complaint<d::Fault>([&] { converter = rig.open(); });  // this computer may be busy
        return converter != nullptr;
      },
      d::kLong));
  const std::vector<std::string> names{"silent", "deaf", "wrong", "cut", "late=0.15", "unplug=0.01"};
  std::uniform_real_distribution<double> volt(-2, 2);
  int successes = 0;
  int faults = 0;
  for (int i = 0; i < 25; ++i) {
    if (i % 5 == 0) {
      std::string fault = names.at(random() % names.size());
      fault.insert(fault.find('=') == std::string::npos ? fault.size() : fault.find('='),
                   "@" + std::to_string(rig.board.commands() + 1 + random() % 4));
      rig.board.inject(fault);
    }
    try {
      const d::Volts held = converter->put({volt(random), volt(random), 2.5});
      expectSame(held, rig.board.volts());
      ++successes;
    } catch (const d::Fault&) {
      ++faults;
      recover(*converter);
    }
  }
  EXPECT_GT(successes, 5);
  EXPECT_GE(faults, least_faults);
}

}  // namespace

TEST(DacSerial, ReferenceFirstAndNothingBeforeTheFirstPut) {
  Rig rig;
  const auto converter = rig.open();
  EXPECT_EQ(rig.board.heard(), (std::vector<std::string>{"ID?", "RANGE 5"}));
  EXPECT_EQ(converter->name(), "serial " + (rig.folder / "port") + ": ASCII-DAC ");
  const d::Volts held = converter->put(d::kNeutral);
  // 819 / V: 2.5 V is 2047.5; half away from zero. V_f and V_s are counted from what the reference then is
  EXPECT_EQ(rig.board.heard(), (std::vector<std::string>{"ID?", "RANGE 5", "WC0800", "WA0800", "WB0800"}));
  EXPECT_DOUBLE_EQ(held.translation, 0);
  EXPECT_DOUBLE_EQ(held.reference, 2048 / 819.0);
}

TEST(DacSerial, SaysWhatIsReallyHeld) {
  Rig rig;
  const auto converter = rig.open();
  for (const d::Volts& volts : {d::kMoving, d::Volts{99, -99, 99}, d::Volts{0.1234, 0.0001, 2.41}}) {
    const d::Volts held = converter->put(volts);
    const d::Volts board = rig.board.volts();
    EXPECT_DOUBLE_EQ(held.translation, board.translation);
    EXPECT_DOUBLE_EQ(held.steering, board.steering);
    EXPECT_DOUBLE_EQ(held.reference, board.reference);
  }
  EXPECT_NEAR(converter->put({99, -99, 99}).translation, 2.2, 1 / 819.0);
  EXPECT_NEAR(converter->put({99, -99, 99}).steering, -1, 1 / 819.0);
}

TEST(DacSerial, OneFrameForAll) {
  Rig rig(d::kOneFrame);
  const auto converter = rig.open();
  converter->put(d::kMoving);
  EXPECT_EQ(rig.board.heard().back(),
            "S80099A733");  // 2048; 2048 + 409.5 -> 2457.5 -> 2458; 2048 - 204.75 -> 1843
  EXPECT_EQ(rig.board.history().size(), 1U) << "all at once";
  EXPECT_EQ(rig.board.codes(), (std::array<int, 3>{2048, 2458, 1843}));
}

TEST(DacSerial, ABoardThatNeverAnswersIsTold) {
  Rig rig({{R"("OK {ch}{code:04X}")", R"("")"},
           {R"(send: "RANGE 5", expect: "OK")", R"(send: "RANGE 5", expect: "")"}});
  const auto converter = rig.open();
  converter->put(d::kMoving);
  ASSERT_TRUE(rig.heardAll(5));
  EXPECT_NEAR(rig.board.volts().steering, -0.25, 1e-3);
}

TEST(DacVirtualBoard, LogsEveryChangeInNanoseconds) {
  Rig rig;
  const auto converter = rig.open();
  converter->put(d::kNeutral);
  converter->put(d::kNeutral);
  converter->put(d::kMoving);
  const std::vector<d::Change> history = rig.board.history();
  ASSERT_EQ(history.size(), 5U);  // three, none, and all but the reference
  EXPECT_FALSE(rig.board.isNeutral(history[1].volts));
  EXPECT_TRUE(rig.board.isNeutral(history[2].volts));
  EXPECT_FALSE(rig.board.isNeutral(history[3].volts));
  std::istringstream log(d::textOf(rig.folder / "log"));
  std::int64_t last = 0;
  for (const d::Change& change : history) {
    std::int64_t time = 0;
    std::string what;
    d::Volts volts{};
    ASSERT_TRUE(log >> time >> what >> volts.translation >> volts.steering >> volts.reference);
    EXPECT_EQ(time, change.time);
    EXPECT_EQ(what, "volts");
    EXPECT_NEAR(volts.translation, change.volts.translation, 1e-6);
    EXPECT_GT(time, last);
    last = time;
  }
}

TEST(DacVirtualBoard, RefusesFaultsThatAreNone) {
  for (const char* text :
       {"", "late", "silent=1", "sulk", "late@0=1", "late@1x0=1", "late=-1", "late=1e3", "deaf@x2"}) {
    EXPECT_THROW(d::boardFault(text, 0), std::invalid_argument) << text;
  }
  const d::BoardFault fault = d::boardFault("late@5x3=0.25", 1);
  EXPECT_EQ(fault.what, d::BoardFault::kLate);
  EXPECT_EQ(fault.at, 5U);
  EXPECT_EQ(fault.count, 3U);
  EXPECT_DOUBLE_EQ(fault.value, 0.25);
  EXPECT_EQ(d::boardFault("deaf", 7).at, 8U);
}

TEST(DacSerial, WhateverIsAskedForTheBoardStaysWithinTheClamp) {
  Rig rig;
  const auto converter = rig.open();
  std::mt19937 random(5);
  const auto anything = [&random] {
    const std::vector<double> odd{std::nan(""),
                                  HUGE_VAL,
                                  -HUGE_VAL,
                                  std::numeric_limits<double>::max(),
                                  std::numeric_limits<double>::lowest(),
                                  -0.0};
    if (random() % 4 == 0) return odd.at(random() % odd.size());
    return std::ldexp(std::uniform_real_distribution<double>(-1, 1)(random),
                      static_cast<int>(random() % 40) - 20);
  };
  for (int i = 0; i < 300; ++i) {
    try {
      const d::Volts held = converter->put({anything(), anything(), anything()});
      expectSame(held, rig.board.volts());
    } catch (const std::invalid_argument&) {
      continue;
    }
  }
  const std::vector<d::Change> history = rig.board.history();
  ASSERT_GT(history.size(), 100U);
  for (std::size_t i = 2; i < history.size(); ++i) {  // the first two come before the others' first command
    EXPECT_TRUE(isWithin(history[i].volts.reference, rig.device.channels[d::kReference].volt));
  }
  EXPECT_TRUE(isWithin(rig.board.volts().translation, rig.device.channels[d::kTranslation].volt));
  EXPECT_TRUE(isWithin(rig.board.volts().steering, rig.device.channels[d::kSteering].volt));
}

TEST(DacSerial, SuccessIsTrueUnderFaultsWhereRepliesAreAlike) { rideThroughFaults(d::kOneFrame, 1, 1); }

TEST(DacSerial, SuccessIsTrueUnderFaultsWhereRepliesTellTheValue) { rideThroughFaults({}, 3, 1); }

TEST(DacSerial, SuccessIsTrueUnderFaultsInABurst) {
  rideThroughFaults(d::kBurst, 3, 0);
  d::Edits alike = d::kBurst;
  alike.emplace_back(R"("OK {ch}{code:04X}")", R"("OK")");
  rideThroughFaults(alike, 1, 0);
}

}  // namespace test_dac_serial
