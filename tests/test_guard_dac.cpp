// SPDX-License-Identifier: BSD-3-Clause
// base_node's side of the guard: what counts as put out, for odometry and diagnostics.
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <filesystem>
#include <string>

#include "base/guard_dac.h"
#include "guard/socket.h"
#include "steady.h"

namespace test_guard_dac {

namespace k = kurumaisu;
namespace g = kurumaisu::guard;

namespace {

const k::AxisLaw kTranslation{{1.32402, 0.127906}, {2.07369, -0.108783}};
const k::AxisLaw kSteering{{-0.499211, 0.104181}, {-0.469278, -0.169476}};

/// A guard that answers as a test wishes: to each message, before it comes.
class FakeGuard : public testing::Test {
 protected:
  FakeGuard() {
    std::string name = (std::filesystem::temp_directory_path() / "guard_XXXXXX").string();
    folder = mkdtemp(name.data());
    listener = g::listenAt(folder / "socket");
  }
  ~FakeGuard() override { std::filesystem::remove_all(folder); }

  /// What the base takes for put out when it asks for 0.5 m/s and 0.3 rad/s and hears this.
  k::Output heard(g::State state, double translation, double steering) {
    k::GuardDac dac({folder / "socket", 0.02, 0.01}, 0.15, {kTranslation, kSteering});
    const k::Output asked{kTranslation.volts(0.5), kSteering.volts(0.3), 2.5, 0.5, 0.3};
    dac.put(asked);  // connects
    kurumaisu::Descriptor peer(accept(listener.get(), nullptr, nullptr));
    g::Reply reply{};
    reply.magic = g::kMagic;
    reply.version = g::kVersion;
    reply.state = static_cast<std::uint16_t>(state);
    reply.device = 1;
    reply.sequence = 2;  // the next
    reply.translation = translation;
    reply.steering = steering;
    reply.reference = 2.5;
    g::send(peer, &reply, sizeof reply);
    const k::Output result = dac.put(asked);
    late = dac.status().late;
    return result;
  }

  std::filesystem::path folder;
  kurumaisu::Descriptor listener;
  std::uint64_t late = 0;
};

TEST_F(FakeGuard, WhatIsHeldStandsForItsRates) {
  const double v_f = kTranslation.volts(0.5);
  const double v_s = kSteering.volts(0.3);
  const k::Output whole = heard(g::State::kArmed, v_f, v_s);
  EXPECT_EQ(whole.v, 0.5);
  EXPECT_EQ(whole.w, 0.3);
  EXPECT_EQ(late, 1U);  // of the first, which nobody answers
}

TEST_F(FakeGuard, OtherVoltagesStandForOtherRates) {
  const k::Output clamped = heard(g::State::kArmed, 0.4, -0.02);
  EXPECT_NEAR(clamped.v, (0.4 - 0.127906) / 1.32402, 1e-12);
  EXPECT_NEAR(clamped.w, (-0.02 - 0.104181) / -0.499211, 1e-12);  // ambiguous: by the sign that was asked for
  EXPECT_EQ(heard(g::State::kArmed, 0.1, 0).v, 0);                // inside the dead zone
}

TEST_F(FakeGuard, NotArmedIsAtRest) {
  for (const g::State state : {g::State::kIdle, g::State::kHolding, g::State::kTripped}) {
    const k::Output refused = heard(state, 0.0006, -0.0006);  // neutral to the nearest code
    EXPECT_EQ(refused.translation, 0.0006);
    EXPECT_EQ(refused.v, 0);
    EXPECT_EQ(refused.w, 0);
  }
}

TEST(GuardReport, SaysWhatIsWrong) {
  g::Status status;
  EXPECT_TRUE(k::reportGuard(status, {}, 10).error);
  EXPECT_NE(k::reportGuard(status, {}, 10).summary.find("no guard"), std::string::npos);
  status.reason = g::Reason::kBusy;
  EXPECT_EQ(k::reportGuard(status, {}, 10).summary, "neutral: another client is connected");
  status = {};
  status.connected = true;
  EXPECT_TRUE(k::reportGuard(status, {}, 10).error);  // no device
  status.has_device = true;
  status.state = g::State::kArmed;
  status.answered = 9.5;
  k::Report report = k::reportGuard(status, status, 10);
  EXPECT_FALSE(report.warning);
  EXPECT_FALSE(report.error);
  EXPECT_EQ(report.summary, "armed");
  EXPECT_EQ(report.values.back().second, "0.500000");
  g::Status before = status;
  ++status.late;
  EXPECT_TRUE(k::reportGuard(status, before, 10).warning);
  status.state = g::State::kTripped;
  status.reason = g::Reason::kStep;
  EXPECT_EQ(k::reportGuard(status, status, 10).summary,
            "tripped: step too large: release the input to arm again");
  EXPECT_TRUE(k::reportGuard(status, status, 10).warning);
}

}  // namespace

}  // namespace test_guard_dac
