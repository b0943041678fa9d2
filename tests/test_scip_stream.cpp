// SPDX-License-Identifier: BSD-3-Clause
// The assembler, however the bytes come: in what pieces, glued, without ends, in SCIP 1.1.
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "scip/message.h"
#include "scip_frames.h"

namespace test_scip_stream {

namespace s = kurumaisu::scip;

namespace {

const std::string kCommand = "MS0100012001000";
const frames::Scan kScan{77, std::vector<std::uint32_t>(21, 1234)};
const std::string kFrame = frames::scan(kCommand, kScan);

bool operator==(const s::Message& a, const s::Message& b) {
  return a.command == b.command && a.status == b.status && a.lines == b.lines && a.bad_sums == b.bad_sums;
}

std::vector<s::Message> messagesOf(s::Assembler& assembler) {
  std::vector<s::Message> messages;
  while (auto message = assembler.next()) messages.push_back(*message);
  return messages;
}

std::vector<s::Message> messagesOf(const std::string& bytes) {
  s::Assembler assembler;
  assembler.add(bytes, 0);
  return messagesOf(assembler);
}

}  // namespace

TEST(ScipStream, PiecesDoNotMatter) {
  std::mt19937 random(2);
  std::string bytes;
  std::vector<double> echoes;  // [s] when each frame's first byte comes, one byte in a millisecond
  for (int k = 0; k < 200; ++k) {
    for (std::size_t left = random() % 4; left > 0; --left) bytes += "\nx\x01"[random() % 3];
    echoes.push_back(1e-3 * static_cast<double>(bytes.size()));
    bytes += random() % 9 == 0 ? kFrame.substr(0, random() % 20) + kFrame : kFrame;
  }
  s::Assembler whole;
  whole.add(bytes, 0);
  const std::vector<s::Message> expected = messagesOf(whole);
  ASSERT_GE(expected.size(), 200U);
  for (const std::size_t most : {1, 7, 500, 5000}) {
    s::Assembler assembler;
    std::vector<s::Message> found;
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t size = 1 + random() % most;
      assembler.add(bytes.substr(at, size), 1e-3 * static_cast<double>(at));
      for (const s::Message& message : messagesOf(assembler)) found.push_back(message);
      at += size;
    }
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t k = 0; k < found.size(); ++k) EXPECT_TRUE(found[k] == expected[k]) << k;
    EXPECT_EQ(assembler.counts().stray_bytes, whole.counts().stray_bytes);
    EXPECT_EQ(assembler.counts().unreadable, whole.counts().unreadable);
    EXPECT_EQ(assembler.counts().cut, whole.counts().cut);
  }
}

TEST(ScipStream, TheFirstByteIsTheEchos) {
  for (const std::string noise : {"", "\n\n", "noise", "n\n\n", "MS0100"}) {
    s::Assembler assembler;
    const std::string bytes = noise + kFrame;
    for (std::size_t at = 0; at < bytes.size(); ++at) {
      ASSERT_FALSE(assembler.next()) << noise;
      assembler.add(bytes.substr(at, 1), static_cast<double>(at));
    }
    EXPECT_EQ(assembler.next().value().first_byte, static_cast<double>(noise.size())) << noise;
  }
}

TEST(ScipStream, ARepliesRestKeepsTheTimeOfItsPiece) {
  s::Assembler assembler;
  assembler.add(kFrame + kFrame.substr(0, 9), 1.0);
  EXPECT_EQ(messagesOf(assembler).size(), 1U);
  assembler.add(kFrame.substr(9) + kFrame, 2.0);
  const std::vector<s::Message> messages = messagesOf(assembler);
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0].first_byte, 1.0);
  EXPECT_EQ(messages[1].first_byte, 2.0);
}

TEST(ScipStream, AMissingEndCostsTheReplyItEnds) {
  for (const std::size_t missing : {1U, 2U}) {
    s::Assembler assembler;
    assembler.add(kFrame.substr(0, kFrame.size() - missing) + frames::reply("QT", "00"), 0);
    assembler.expect("QT");
    EXPECT_EQ(assembler.next().value().command, "QT");
    EXPECT_FALSE(assembler.next());
    EXPECT_EQ(assembler.counts().cut, 1U);
  }
  const std::vector<s::Message> found =
      messagesOf("BM\n00P\n" + frames::reply(kCommand, "00") + kFrame.substr(0, kFrame.size() - 2) + kFrame);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].status, "00");
  EXPECT_EQ(found[1].status, "99");
  EXPECT_EQ(found[1].lines.size(), 2U);
}

TEST(ScipStream, RepliesWithTheirStrings) {
  const std::string command = kCommand + ";a string @1_2.+";
  const std::vector<s::Message> found =
      messagesOf("noise" + frames::scan(command, kScan) + frames::reply("VV;x", "00"));
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].command, command);
  EXPECT_EQ(found[1].command, "VV;x");
}

TEST(ScipStream, Scip11) {
  const std::vector<s::Message> found = messagesOf("QT\nE\n\nSCIP2.0\n0\n\nV\n0\nVEND:x\nPROD:y\n\n");
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].status, "E");
  EXPECT_EQ(found[1].command, "SCIP2.0");
  EXPECT_EQ(found[1].status, "0");
  EXPECT_EQ(found[2].lines, (std::vector<std::string>{"VEND:x", "PROD:y"}));
  EXPECT_EQ(found[2].bad_sums, 0);
}

TEST(ScipStream, NoiseIsNoReply) {
  s::Assembler assembler;
  assembler.add("\x80\xff\n0\n\n" + std::string(80, 'x') + "\n00P\n\n\nonly a line\n\n", 0);
  EXPECT_FALSE(assembler.next());
  EXPECT_EQ(assembler.counts().unreadable, 3U);
  EXPECT_EQ(assembler.counts().messages, 0U);
}

TEST(ScipStream, ForgettingStartsAnew) {
  s::Assembler assembler;
  assembler.add(kFrame.substr(0, 50), 1.0);
  EXPECT_FALSE(assembler.next());
  assembler.clear();
  assembler.add(kFrame, 2.0);
  EXPECT_EQ(assembler.next().value().first_byte, 2.0);
}

}  // namespace test_scip_stream
