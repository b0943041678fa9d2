// SPDX-License-Identifier: BSD-3-Clause
// A reply is never taken for another command's, whatever is lost or late: against a peer that knows what it obeyed.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "dac/converter.h"
#include "dac/dialogue.h"

namespace test_dac_dialogue {

namespace d = kurumaisu::dac;
namespace s = kurumaisu::serial;

namespace {

constexpr double kTimeout = 0.003;  // [s]
constexpr double kLate = 0.012;     // [s]
constexpr double kForever = 1000;   // [s]

/// A board at the other end. Where several commands are under way, it answers them in any order that delays give.
class Peer : public s::Port {
 public:
  struct Habit {
    bool obeys;
    double delay;  // [s] of the reply; negative: none
    std::string reply;
  };

  std::size_t read(char* buffer, std::size_t size, double timeout) override {
    const double until = kurumaisu::steadyTime() + timeout;
    for (;;) {
      const double now = kurumaisu::steadyTime();
      const auto due =
          std::find_if(replies_.begin(), replies_.end(), [now](const Reply& r) { return r.at <= now; });
      if (due != replies_.end()) {
        const std::size_t count = std::min(size, due->bytes.size());
        due->bytes.copy(buffer, count);
        due->bytes.erase(0, count);
        if (due->bytes.empty()) replies_.erase(due);
        return count;
      }
      if (now >= until) return 0;
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
  }

  void write(std::string_view bytes, double /*timeout*/) override {
    const std::string command(bytes.substr(0, bytes.size() - 1));
    const Habit now = habits.empty() ? Habit{true, 0, "OK"} : habits.front();
    if (!habits.empty()) habits.erase(habits.begin());
    heard.push_back(command);
    if (now.obeys) obeyed.push_back(command);
    if (now.delay >= 0) replies_.push_back({kurumaisu::steadyTime() + now.delay, now.reply + "\n"});
  }

  void say(const std::string& bytes) { replies_.push_back({0, bytes}); }

  bool hasBaud() const override { return false; }
  void setBaud(int /*baud*/) override {}

  std::vector<Habit> habits;  // of the next commands; then it is well-behaved
  std::vector<std::string> heard;
  std::vector<std::string> obeyed;

 private:
  struct Reply {
    double at;
    std::string bytes;
  };
  std::vector<Reply> replies_;
};

struct Talk {
  explicit Talk(int retries, double late = kLate) {
    auto owned = std::make_unique<Peer>();
    peer = owned.get();
    dialogue =
        std::make_unique<d::Dialogue>(std::move(owned), d::Manner{"\r", "\n", kTimeout, late, retries});
  }
  Peer* peer;
  std::unique_ptr<d::Dialogue> dialogue;
};

}  // namespace

/// All replies are alike, "OK". Whoever believes one for a command that the board never obeyed believes in a neutral that
/// is none.
TEST(DacDialogue, SuccessMeansObeyed) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> delay(0, 0.75 * kLate);
  int successes = 0;
  int faults = 0;
  for (int trial = 0; trial < 60; ++trial) {
    Talk talk(trial % 3);
    for (int i = 0; i < 6; ++i) {
      const unsigned fate = random() % 5;
      talk.peer->habits.push_back({fate != 0, fate < 2 ? -1 : fate == 2 ? delay(random) : 0, "OK"});
    }
    for (int i = 0; i < 5; ++i) {
      const std::string command = "N" + std::to_string(i);
      try {
        talk.dialogue->ask(command, "OK");
        ++successes;
        EXPECT_EQ(std::count(talk.peer->obeyed.begin(), talk.peer->obeyed.end(), command) > 0, true)
            << "trial " << trial << ", " << command;
      } catch (const d::Fault&) {
        ++faults;
      }
    }
  }
  EXPECT_GT(successes, 50);
  EXPECT_GT(faults, 50);
}

TEST(DacDialogue, RepliesThatCannotBeMixedUpAreNotWaitedFor) {
  Talk talk(0, kForever);
  talk.peer->habits = {{true, -1, ""}};
  EXPECT_THROW(talk.dialogue->ask("1", "OK 1"), d::Fault);
  EXPECT_FALSE(talk.dialogue->inDoubt("OK 2"));
  EXPECT_TRUE(talk.dialogue->inDoubt("OK 1"));
  EXPECT_TRUE(talk.dialogue->inDoubt("OK *"));
  EXPECT_TRUE(talk.dialogue->inDoubt("*1")) << "nobody compares two patterns";
  talk.peer->habits = {{true, 0.0, "OK 2"}};
  EXPECT_EQ(talk.dialogue->ask("2", "OK 2"), "OK 2");
}

TEST(DacDialogue, ALateReplyBeforeTheRightOneIsSkipped) {
  Talk talk(0, kForever);
  talk.peer->habits = {{true, -1, ""}, {true, 0, "OK 1\nOK 2"}, {true, 0, "OK 1\nOK 3"}};
  talk.dialogue->tell("1", "OK 1");
  EXPECT_EQ(talk.dialogue->ask("2", "OK 2"), "OK 2");
  EXPECT_THROW(talk.dialogue->ask("3", "OK 3"), d::Fault) << "nothing is owed any more";
}

TEST(DacDialogue, WhatComesUnaskedAnswersNothing) {
  Talk talk(0);
  talk.peer->say("OK\nOK\n");
  talk.peer->habits = {{false, -1, ""}};
  EXPECT_THROW(talk.dialogue->ask("1", "OK"), d::Fault);
}

TEST(DacDialogue, ABoardThatDoesNotStopTalkingIsAFault) {
  Talk talk(0);
  for (int i = 0; i < 1000; ++i) talk.peer->say(std::string(2000, 'x'));
  EXPECT_THROW(talk.dialogue->ask("1", "OK"), d::Fault);
  Talk lines(0);
  for (int i = 0; i < 2000; ++i) lines.peer->say("OK\n");
  EXPECT_THROW(lines.dialogue->ask("1", "OK"), d::Fault);
}

TEST(DacDialogue, PatternsAreTheShells) {
  for (const auto& [reply, expect] :
       std::vector<std::pair<std::string, std::string>>{{"OK 12", "OK ??"},
                                                        {"R0A", "R[0-9][A-F]"},
                                                        {"", "*"},
                                                        {"a*b", "a*b"},
                                                        {"back\\slash", "back\\slash"}}) {
    Talk talk(0);
    talk.peer->habits = {{true, 0, reply}};
    EXPECT_EQ(talk.dialogue->ask("1", expect), reply);
  }
  for (const auto& [reply, expect] :
       std::vector<std::pair<std::string, std::string>>{{"OK 123", "OK ??"},
                                                        {"ok", "OK"},
                                                        {"OK ", "OK"},
                                                        {std::string("OK\0", 3), "OK"},
                                                        {"RAA", "R[0-9]A"}}) {
    Talk talk(0);
    talk.peer->habits = {{true, 0, reply}};
    EXPECT_THROW(talk.dialogue->ask("1", expect), d::Fault) << reply;
  }
}

TEST(DacDialogue, MessagesShowControlCharacters) {
  EXPECT_EQ(d::readable(std::string("A\r\0\xff~", 5)), R"("A\x0D\x00\xFF~")");
}

}  // namespace test_dac_dialogue
