// SPDX-License-Identifier: BSD-3-Clause
// Frames damaged in every way that a line, a cable or a sensor can: no scan may come of them that was not sent.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "scip/code.h"
#include "scip/message.h"
#include "scip/request.h"
#include "scip/scan.h"
#include "scip_frames.h"

namespace test_scip_damage {

namespace s = kurumaisu::scip;
using frames::Scan;

namespace {

const std::string kFull = "MD0044072501000";   // 682 beams, as a URG-04LX has them
const std::string kSmall = "ME0044006502000";  // 11 beams of 66 characters: a full line and one of two

/// Scans that differ in every line; their clocks count from 1.
std::vector<Scan> scansOf(const std::string& command, std::size_t count) {
  const s::Request request = s::request(command).value();
  const int numbers = s::beams(request) * s::width(request.form) / frames::widthOf(command);
  std::mt19937 random(7);
  std::vector<Scan> scans(count);
  for (Scan& scan : scans) {
    scan.clock = static_cast<std::uint32_t>(1 + &scan - scans.data());
    for (int k = 0; k < numbers; ++k) scan.numbers.push_back(random() % 5601);
  }
  return scans;
}

/// Every scan that comes of the bytes.
std::vector<Scan> decoded(const std::string& bytes, const std::string& command) {
  const s::Request request = s::request(command).value();
  std::vector<Scan> scans;
  s::Assembler assembler;
  assembler.add(bytes, 0);
  while (const auto message = assembler.next()) {
    try {
      const s::Rotation rotation = s::decodeScan(*message, request);
      Scan scan{rotation.clock, {}};
      for (std::size_t k = 0; k < rotation.distances.size(); ++k) {
        scan.numbers.push_back(static_cast<std::uint32_t>(rotation.distances[k]));
        if (!rotation.intensities.empty())
          scan.numbers.push_back(static_cast<std::uint32_t>(rotation.intensities[k]));
      }
      scans.push_back(scan);
    } catch (const s::BadFrame&) {
    }
  }
  return scans;
}

/// A stream of three scans of which the second is damaged.
class Damage {
 public:
  explicit Damage(std::string command) : command_(std::move(command)), scans_(scansOf(command_, 3)) {
    for (const Scan& scan : scans_) texts_.push_back(frames::scan(command_, scan));
  }

  const std::string& frame() const { return texts_[1]; }

  /// Says whether the damaged frame became a scan that was not sent; the others must come of the bytes as they were.
  bool lies(const std::string& damaged) const {
    std::vector<Scan> found = decoded(texts_[0] + damaged + texts_[2], command_);
    EXPECT_GE(found.size(), 2U);
    EXPECT_LE(found.size(), 3U);
    EXPECT_EQ(found.front(), scans_.front());
    EXPECT_EQ(found.back(), scans_.back());
    return found.size() == 3 && !(found[1] == scans_[1]);
  }

  /// Says whether exactly the two undamaged scans come of the bytes.
  bool loses(const std::string& damaged) const {
    return decoded(texts_[0] + damaged + texts_[2], command_) == std::vector<Scan>{scans_[0], scans_[2]};
  }

 private:
  std::string command_;
  std::vector<Scan> scans_;
  std::vector<std::string> texts_;
};

double secondsFor(const std::string& bytes) {
  const auto start = std::chrono::steady_clock::now();
  decoded(bytes, kFull);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::string repeated(const std::string& part, std::size_t bytes) {
  std::string text;
  while (text.size() < bytes) text += part;
  return text;
}

}  // namespace

TEST(ScipDamage, AWholeFrameIsWhatWasSent) {
  EXPECT_EQ(frames::scan(kFull, scansOf(kFull, 1)[0]).size(), 2137U);
  for (const char* name : {"MD", "MS", "ME", "GD", "GS", "GE"}) {
    const std::string command = name + std::string(name[0] == 'M' ? "0044072501000" : "0044072501");
    std::vector<Scan> sent = scansOf(command, 1);
    for (std::uint32_t& number : sent[0].numbers) number %= 4096;
    EXPECT_EQ(decoded(frames::scan(command, sent[0]), command), sent) << command;
  }
}

// The alphabet is as wide as the sum: another character has another sum, another byte is no character.
TEST(ScipDamage, AByteChangedAnywhere) {
  const Damage small(kSmall);
  for (std::size_t at = 0; at < small.frame().size(); ++at) {
    for (int value = 0; value < 256; ++value) {
      std::string damaged = small.frame();
      damaged[at] = static_cast<char>(value);
      ASSERT_FALSE(small.lies(damaged)) << at << " " << value;
    }
  }
  const Damage full(kFull);
  for (std::size_t at = 0; at < full.frame().size(); ++at) {
    for (const int flip : {0x01, 0x20, 0x40, 0x80, full.frame()[at] ^ '\n', full.frame()[at] ^ '0'}) {
      std::string damaged = full.frame();
      damaged[at] = static_cast<char>(damaged[at] ^ flip);
      ASSERT_FALSE(full.lies(damaged)) << at << " " << flip;
    }
  }
}

TEST(ScipDamage, AByteTooManyOrTooFewAnywhere) {
  const Damage small(kSmall);
  for (std::size_t at = 0; at < small.frame().size(); ++at) {
    for (int value = 0; value < 256; ++value) {
      std::string damaged = small.frame();
      damaged.insert(at, 1, static_cast<char>(value));
      ASSERT_FALSE(small.lies(damaged)) << at << " " << value;
    }
  }
  for (const std::string& command : {kSmall, kFull}) {
    const Damage damage(command);
    for (std::size_t at = 0; at < damage.frame().size(); ++at)
      ASSERT_FALSE(damage.lies(std::string(damage.frame()).erase(at, 1))) << at;
  }
}

TEST(ScipDamage, CutAnywhereItCostsOneScan) {
  for (const std::string& command : {kSmall, kFull}) {
    const Damage damage(command);
    const std::string& frame = damage.frame();
    for (std::size_t at = 1; at < frame.size(); ++at) {
      ASSERT_FALSE(damage.lies(frame.substr(0, at))) << at;
      ASSERT_TRUE(damage.loses(frame.substr(0, std::min(at, frame.size() - 2)))) << at;
      ASSERT_TRUE(at >= frame.size() - 2 || damage.loses(frame.substr(at))) << at;
    }
    std::mt19937 random(3);
    for (int k = 0; k < 2000; ++k) {
      const std::size_t from = 1 + random() % (frame.size() - 3);
      ASSERT_FALSE(damage.lies(std::string(frame).erase(from, 1 + random() % (frame.size() - from)))) << from;
    }
  }
}

TEST(ScipDamage, NoiseBetweenFramesCostsNoScan) {
  const std::vector<Scan> scans = scansOf(kSmall, 4);
  const std::vector<std::string> noises = {"\n",        "\n\n\n", "x",    "\n0\n",      "M",
                                           "\nMD\n99b", "99b\n",  "\r\n", "MD0044\n\n", "0\n\n0"};
  for (const std::string& noise : noises) {
    std::string bytes = noise;
    for (const Scan& scan : scans) bytes += frames::scan(kSmall, scan) + noise;
    EXPECT_EQ(decoded(bytes, kSmall), scans) << noise;
  }
  std::mt19937 random(11);
  for (int k = 0; k < 5000; ++k) {
    std::string bytes;
    for (const Scan& scan : scans) {
      for (std::size_t left = random() % 40; left > 0; --left)
        bytes += random() % 6 == 0 ? '\n' : static_cast<char>(random());
      bytes += frames::scan(kSmall, scan);
    }
    ASSERT_EQ(decoded(bytes, kSmall), scans) << k;
  }
}

// What no receiver can see, and how often: two errors in one line that cancel out.
TEST(ScipDamage, WhatSixBitsOfSumCannotSee) {
  const Damage damage(kFull);
  const std::string& frame = damage.frame();
  const std::size_t data = frame.find('\n', kFull.size() + 5) + 1;  // after echo, status and clock
  std::mt19937 random(5);
  int in_a_line = 0;
  int anywhere = 0;
  constexpr int kTrials = 20000;
  for (int k = 0; k < kTrials; ++k) {
    std::string damaged = frame;
    const std::size_t line = data + 66 * (random() % 31);
    const std::size_t first = random() % 64;
    const std::size_t second = (first + 1 + random() % 63) % 64;
    for (const std::size_t at : {first, second}) {
      const char before = damaged[line + at];
      damaged[line + at] = static_cast<char>('0' + (before - '0' + 1 + static_cast<int>(random() % 63)) % 64);
    }
    in_a_line += damage.lies(damaged) ? 1 : 0;
    damaged = frame;
    for (int change = 0; change < 2; ++change) damaged[random() % frame.size()] = static_cast<char>(random());
    anywhere += damage.lies(damaged) ? 1 : 0;
  }
  EXPECT_NEAR(in_a_line / double{kTrials}, 1.0 / 63, 4 * std::sqrt(1.0 / 63 / kTrials));
  EXPECT_LE(anywhere,
            1);  // two bytes out of 2137 share a line once in 32, are in the alphabet once in 16 ...
  RecordProperty("two_characters_of_a_line", in_a_line);
  RecordProperty("two_bytes_of_a_frame", anywhere);
}

// An '@' counts nothing in a sum: if one moves to another line, only the lines' lengths tell.
TEST(ScipDamage, ACharacterThatMovesToAnotherLine) {
  Scan scan = scansOf(kFull, 1)[0];
  for (std::size_t k = 0; k < scan.numbers.size(); k += 3) scan.numbers[k] = 16;  // "00@"
  const std::string frame = frames::scan(kFull, scan);
  const std::size_t data = frame.find('\n', kFull.size() + 5) + 1;
  int moved = 0;
  for (std::size_t from = data; from < frame.size(); ++from) {
    if (frame[from] != '@' || (from - data) % 66 >= 64) continue;
    for (std::size_t line = data; line + 2 < frame.size(); line += 66) {
      if (from >= line && from < line + 66) continue;
      std::string damaged = frame;
      damaged.erase(from, 1);
      damaged.insert(from < line ? line - 1 : line, "@");
      for (const Scan& found : decoded(damaged, kFull)) ASSERT_EQ(found, scan) << from << " to " << line;
      ++moved;
    }
  }
  EXPECT_GT(moved, 1000);
}

TEST(ScipDamage, NeitherNoiseNorFloodTakesMoreThanLinearTime) {
  constexpr std::size_t kBytes = 1 << 20;
  const Scan scan = scansOf(kFull, 1)[0];
  const std::string frame = frames::scan(kFull, scan);
  const std::vector<std::string> floods = {"\n",
                                           "\n\n\nx",
                                           "M",
                                           "G",
                                           "M\n",
                                           "x\nP\n",
                                           "MD0044072501000\n",
                                           "99b\n",
                                           "MD0044072501000\n00P\n\n",
                                           "MD0044072501000\n99b\n",
                                           std::string(1, '\0'),
                                           ";"};
  for (const std::string& flood : floods) {
    const std::string bytes = repeated(flood, kBytes);
    EXPECT_LT(secondsFor(bytes), 0.5) << flood;
    std::vector<Scan> found =
        decoded(std::string(bytes).append(frame).append(frame), kFull);  // the flood may take the first along
    ASSERT_FALSE(found.empty()) << flood;
    EXPECT_EQ(found.back(), scan) << flood;
  }
}

}  // namespace test_scip_damage
