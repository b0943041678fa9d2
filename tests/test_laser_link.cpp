// SPDX-License-Identifier: BSD-3-Clause
// Replies, and how a sensor is found, against a peer that is scripted here.
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "laser/driver.h"
#include "laser/fan.h"
#include "laser/handshake.h"
#include "laser/link.h"
#include "laser/tcp.h"
#include "laser/tty.h"
#include "laser/urg.h"
#include "laser_peer.h"

namespace test_laser_link {

namespace l = kurumaisu::laser;
namespace scip = kurumaisu::scip;
using namespace kurumaisu::test;  // NOLINT(google-build-using-namespace)

namespace {

std::string parameters(const std::map<std::string, std::string>& changed = {}) {
  std::string lines;
  for (const auto& [key, value] : std::vector<std::pair<std::string, std::string>>{{"MODL", "URG-04LX"},
                                                                                   {"DMIN", "20"},
                                                                                   {"DMAX", "5600"},
                                                                                   {"ARES", "1024"},
                                                                                   {"AMIN", "44"},
                                                                                   {"AMAX", "725"},
                                                                                   {"AFRT", "384"},
                                                                                   {"SCAN", "600"}}) {
    const auto found = changed.find(key);
    lines += keyed(key + ":" + (found == changed.end() ? value : found->second));
  }
  return lines;
}

/// A sensor that is idle and speaks SCIP 2.0.
std::string idle(const std::string& command) {
  if (command == "QT" || command == "BM") return reply(command, "00");
  if (command == "TM2") return reply(command, "03");
  if (command == "VV") return reply(command, "00", keyed("VEND:Hokuyo") + keyed("SERI:H1"));
  if (command == "PP") return reply(command, "00", parameters());
  if (command == "II") return reply(command, "00", keyed("STAT:Sensor works well."));
  if (command == "HS0") return reply(command, "02");
  return reply(command, "0E");
}

class LinkTest : public testing::Test {
 protected:
  /// A link to a peer that answers so.
  void connect(const Peer::Answer& answer) {
    link.emplace(std::make_unique<l::Tty>(pty.path(), kBaud), l::steadyTime, [this] { return stop.load(); });
    peer.emplace(pty.fd(), answer);
  }

  l::Sensor shake(bool ask_once = false) {
    return l::handshake(*link, {kBaud, 0.3, ask_once},
                        [this](l::Report::Level, const std::string& text) { told += text + "\n"; });
  }

  Pty pty;
  std::atomic<bool> stop{false};
  std::optional<l::Link> link;
  std::optional<Peer> peer;
  std::string told;
};

}  // namespace

TEST_F(LinkTest, AnAnswerIsFoundAmongOthers) {
  connect([](const std::string& command) {
    return "noise" + reply("MD0044072501000", "99", summed("0000")) + reply("XX", "0E") +
           reply(command, "00");
  });
  EXPECT_EQ(link->ask("BM", 0.5).status, "00");
}

TEST_F(LinkTest, NoAnswerIsOneInTime) {
  connect([](const std::string&) { return ""; });
  const double time = seconds([&] { EXPECT_THROW(link->ask("PP", 0.1), l::LinkLost); });
  EXPECT_GE(time, 0.1);
  EXPECT_LT(time, 0.3);
  stop = true;
  EXPECT_LT(seconds([&] { EXPECT_THROW(link->ask("PP", 60), l::LinkLost); }), 0.2);
}

TEST_F(LinkTest, NoiseWithoutEndDoesNotHoldItUp) {
  connect([](const std::string&) { return ""; });
  std::atomic<bool> enough{false};
  std::thread noise([&] {
    while (!enough) {
      peer->say("\x01garbage\n0\n");
      usleep(2000);
    }
  });
  const double time = seconds([&] { EXPECT_FALSE(link->ask("QT", 0.1, 0.3)); });
  enough = true;
  noise.join();
  EXPECT_GE(time, 0.29);
  EXPECT_LT(time, 0.6);
}

TEST_F(LinkTest, AnIdleSensorSaysWhatItIs) {
  connect(idle);
  const l::Sensor sensor = shake();
  EXPECT_EQ(sensor.parameters.last, 725);
  EXPECT_EQ(sensor.baud, kBaud);
  EXPECT_EQ(sensor.state.at("STAT"), "Sensor works well.");
  EXPECT_EQ(told, "");
}

TEST_F(LinkTest, AColdSensorIsFoundAtItsRateAndBroughtToOurs) {
  std::atomic<speed_t> rate{B19200};
  std::atomic<bool> old{true};
  connect([&](const std::string& command) -> std::string {
    if (pty.speed() != rate) return "\xf8\x80\n\x1f";
    if (old && command == "SCIP2.0") {
      old = false;
      return reply(command, "0");
    }
    if (old) return reply(command, "E");
    if (command == "SS115200") {
      // At the old rate; the new one holds after it.
      peer->say(reply(command, "00"));
      tcdrain(pty.fd());
      rate = B115200;
      return "";
    }
    return idle(command);
  });
  const double time = seconds([&] { EXPECT_EQ(shake().baud, kBaud); });
  EXPECT_FALSE(old);
  EXPECT_EQ(rate, static_cast<speed_t>(B115200));
  EXPECT_LT(time, 0.5);
}

TEST_F(LinkTest, ASensorThatRefusesTheRateKeepsItsOwn) {
  connect([&](const std::string& command) -> std::string {
    if (pty.speed() != B19200) return "";
    return command == "SS115200" ? reply(command, "0E") : idle(command);
  });
  EXPECT_EQ(shake().baud, 19200);
  EXPECT_TRUE(has(told, "LASER_BAUD")) << told;
}

TEST_F(LinkTest, AWrongSumOfVVIsToldOnly) {
  connect([](const std::string& command) {
    return command == "VV" ? reply(command, "00", keyed("VEND:Hokuyo") + "SERI:H1;0\n") : idle(command);
  });
  EXPECT_EQ(scip::keyed(shake().version).at("SERI"), "H1");
  EXPECT_TRUE(has(told, "LASER_BAD_SUM: VV")) << told;
}

TEST_F(LinkTest, ASensorThatFallsSilentWhenAskedAgainIsAskedOnce) {
  std::atomic<int> asked{0};
  connect([&](const std::string& command) {
    const bool is_first = command != "VV" || asked++ == 0;
    if (!is_first) return std::string();
    return command == "VV" ? reply(command, "00", keyed("VEND:Hokuyo") + "SERI:H1;0\n") : idle(command);
  });
  EXPECT_THROW(shake(), l::WentSilent);
  asked = 0;
  EXPECT_EQ(scip::keyed(shake(true).version).at("SERI"), "H1");
  EXPECT_TRUE(has(told, "LASER_BAD_SUM: VV, which is asked once, comes with 1 wrong sums")) << told;
}

TEST_F(LinkTest, AWrongSumOfPPIsAskedAgain) {
  std::atomic<int> asked{0};
  connect([&](const std::string& command) {
    const bool is_bad = command == "PP" && ++asked == 1;
    return is_bad ? reply(command, "00", "MODL:X;0\n" + parameters()) : idle(command);
  });
  EXPECT_EQ(shake().parameters.model, "URG-04LX");
  EXPECT_EQ(asked, 2);
  EXPECT_EQ(told, "");
}

TEST_F(LinkTest, ParametersThatCannotBeAreRefused) {
  connect([](const std::string& command) {
    return command == "PP" ? reply(command, "00", parameters({{"ARES", "0"}})) : idle(command);
  });
  const std::string refusal = problem([&] { shake(); });
  EXPECT_TRUE(has(refusal, "LASER_BAD_PP") && has(refusal, "ARES")) << refusal;
}

TEST_F(LinkTest, ASensorInAdjustModeIsBroughtBack) {
  bool adjusting = true;
  connect([&](const std::string& command) {
    if (command == "TM2") adjusting = false;
    return adjusting ? reply(command, "0I") : idle(command);
  });
  EXPECT_EQ(shake().parameters.first, 44);
}

namespace {

/// A scan of a request whose distances are a function of the beam.
std::string frame(const scip::Request& request, std::uint32_t clock, int (*distance)(int)) {
  std::string data;
  for (int i = 0; i < scip::beams(request); ++i) {
    data += scip::encode(static_cast<std::uint32_t>(distance(i)), 3);
    if (request.form == scip::Form::kIntensity) data += scip::encode(static_cast<std::uint32_t>(i + 7), 3);
  }
  std::string lines = summed(scip::encode(clock, 4));
  for (std::size_t at = 0; at < data.size(); at += 64) lines += summed(data.substr(at, 64));
  return reply(scip::command(request), "99", lines);
}

int ramp(int beam) { return 20 + 3 * beam; }

}  // namespace

/// MRPT decodes each scan by itself from what the stream hands on: whatever is asked for, both agree.
TEST_F(LinkTest, MrptAndOurDecoderAgree) {
  connect([&](const std::string& command) {
    return scip::request(command) ? reply(command, "00") : idle(command);
  });
  const l::Sensor sensor = shake();
  for (const l::Window& window : {l::Window{-3.14, 3.14, 1, 0, false}, l::Window{-0.3, 1.2, 3, 2, false},
                                  l::Window{0.1, 0.2, 1, 9, true}}) {
    const scip::Request request = l::Fan(sensor.parameters, window).request();
    auto stream = std::make_shared<l::ScipStream>(*link, sensor, request, 0.5);
    l::Urg urg(stream, window.intensity);
    EXPECT_EQ(peer->heard().back(), scip::command(request));
    peer->say(frame(request, 1000, ramp));
    const std::optional<l::Arrival> arrival = stream->await(1);
    ASSERT_TRUE(arrival && arrival->kind == l::Arrival::Kind::kScan) << (arrival ? arrival->text : "none");
    const std::optional<scip::Rotation> decoded = urg.take();
    ASSERT_TRUE(decoded);
    EXPECT_EQ(decoded->distances, arrival->rotation.distances);
    EXPECT_EQ(decoded->intensities, arrival->rotation.intensities);
    EXPECT_EQ(decoded->clock, arrival->rotation.clock);
    ASSERT_EQ(decoded->distances.size(), static_cast<std::size_t>(scip::beams(request)));
    for (std::size_t i = 0; i < decoded->distances.size(); ++i) {
      ASSERT_EQ(decoded->distances[i], ramp(static_cast<int>(i)));
    }
  }
}

TEST_F(LinkTest, WhatIsNoGoodScanIsTold) {
  connect([&](const std::string& command) {
    return scip::request(command) ? reply(command, "00") : idle(command);
  });
  const l::Sensor sensor = shake();
  const scip::Request request = l::Fan(sensor.parameters, {0, 1, 1, 0, false}).request();
  auto stream = std::make_shared<l::ScipStream>(*link, sensor, request, 0.5);
  l::Urg urg(stream, false);
  using Kind = l::Arrival::Kind;
  const auto kind = [&](const std::string& bytes) {
    peer->say(bytes);
    const std::optional<l::Arrival> arrival = stream->await(1);
    return arrival ? arrival->kind : throw std::runtime_error("nothing came");
  };
  const std::string good = frame(request, 5, ramp);
  EXPECT_EQ(kind(good), Kind::kScan);
  EXPECT_EQ(kind(good), Kind::kDuplicate);
  EXPECT_EQ(kind(frame(request, 5, [](int beam) { return ramp(beam) + 1; })),
            Kind::kScan);  // the clock stands
  std::string bad = frame(request, 6, ramp);
  ++bad[40];
  EXPECT_EQ(kind(bad), Kind::kDamaged);
  EXPECT_EQ(kind(reply(scip::command(request), "50")), Kind::kStatus);
  EXPECT_EQ(kind(frame(request, 6, ramp)), Kind::kScan);
  peer->say(reply("VV", "00"));
  EXPECT_FALSE(stream->await(0.1));
}

TEST_F(LinkTest, RefusalsToStartHaveTheirReason) {
  std::atomic<const char*> bm{"01"};
  std::atomic<const char*> start{"00"};
  connect([&](const std::string& command) {
    if (command == "BM") return reply(command, bm.load());
    return scip::request(command) ? reply(command, start.load()) : idle(command);
  });
  const l::Sensor sensor = shake();
  const auto begin = [&](bool intensity) {
    return problem([&] {
      const scip::Request request = l::Fan(sensor.parameters, {0, 1, 1, 0, intensity}).request();
      l::Urg(std::make_shared<l::ScipStream>(*link, sensor, request, 0.2), intensity);
    });
  };
  EXPECT_TRUE(has(begin(false), "LASER_NO_LIGHT: BM is answered by status 01")) << begin(false);
  bm = "10";
  EXPECT_TRUE(has(begin(false), "not yet ready")) << begin(false);
  bm = "02";  // on already
  EXPECT_EQ(begin(false), "nothing");
  start = "0E";
  EXPECT_TRUE(has(begin(false), "LASER_REFUSED: MD")) << begin(false);
  EXPECT_TRUE(has(begin(true), "LASER_NO_INTENSITY: ME")) << begin(true);
  EXPECT_EQ(peer->heard().back().substr(0, 2), "ME");
}

namespace {

/// A driver of the sensor at a pty, and how often it published.
class DriverTest : public testing::Test {
 protected:
  void drive(bool intensity) {
    l::DriverSettings settings{};
    settings.serial_port = pty.path();
    settings.serial_baud = kBaud;
    settings.live = {0, 1, 1, 0, intensity};
    settings.stale_timeout = 0.5;
    settings.error_limit = 4;
    settings.connect_timeout = 0.3;
    settings.answer_timeout = 0.2;
    settings.retry_min = 0.1;
    settings.retry_max = 0.3;
    driver = std::make_unique<l::Driver>(
        settings, [this](const l::Scan&) { ++scans; }, l::steadyTime, [](const l::Report&) {});
    driver->start();
  }

  bool await(const std::function<bool(const l::Status&)>& holds, double timeout) const {
    for (const double until = l::steadyTime() + timeout; l::steadyTime() < until; usleep(2000)) {
      if (holds(driver->status())) return true;
    }
    return false;
  }

  Pty pty;
  std::atomic<int> scans{0};
  std::optional<Peer> peer;
  std::unique_ptr<l::Driver> driver;
};

bool streams(const l::Status& status) { return status.state == l::State::kStreaming; }

}  // namespace

/// Some URG-04LX do not answer to ME, instead of refusing it.
TEST_F(DriverTest, ASensorThatFallsSilentAtIntensitiesIsNotAskedAgain) {
  peer.emplace(pty.fd(), [](const std::string& command) -> std::string {
    const auto request = scip::request(command);
    if (!request) return idle(command);
    if (request->form == scip::Form::kIntensity) return "";
    return reply(command, "00") + frame(*request, 1, ramp);
  });
  drive(true);
  EXPECT_TRUE(await(streams, 2)) << driver->status().last_error;
  EXPECT_FALSE(driver->status().intensity);
  EXPECT_TRUE(has(driver->status().last_error, "LASER_NO_INTENSITY"));
}

TEST_F(DriverTest, ASensorThatWakesUpIsFoundAtOnce) {
  std::atomic<bool> awake{false};
  peer.emplace(pty.fd(), [&](const std::string& command) -> std::string {
    if (!awake) return "";
    const auto request = scip::request(command);
    return request ? reply(command, "00") + frame(*request, 1, ramp) : idle(command);
  });
  drive(false);
  EXPECT_FALSE(await(streams, 0.5));
  EXPECT_TRUE(
      has(driver->status().last_error, "LASER_NO_ANSWER: no sensor answers QT at 115200, 19200 baud"));
  awake = true;
  EXPECT_TRUE(await(streams, 0.6));
}

/// The bytes that make a scan may come one by one, and the sensor may leave amid them.
TEST_F(DriverTest, ACutAnywhereCostsNoMoreThanThatScan) {
  const scip::Request request{true, scip::Form::kDistance, 384, 546, 1, 0, 0};
  peer.emplace(pty.fd(), [&](const std::string& command) {
    return scip::request(command) ? reply(command, "00") : idle(command);
  });
  drive(false);
  ASSERT_TRUE(
      await([&](const l::Status& s) { return s.state == l::State::kStarting && s.scan_period > 0; }, 2));
  const std::string whole = frame(request, 0, ramp);
  int published = 0;
  for (std::size_t cut = 1; cut < whole.size(); cut += 23) {
    const auto clock = static_cast<std::uint32_t>(100 * ++published);
    peer->say(frame(request, clock - 50, ramp).substr(0, cut) + frame(request, clock, ramp));
    ASSERT_TRUE(await([&](const l::Status&) { return scans >= published; }, 1)) << cut;
  }
  EXPECT_EQ(scans, published);
  EXPECT_EQ(driver->status().counts.reconnects, 0U);
}

}  // namespace test_laser_link
