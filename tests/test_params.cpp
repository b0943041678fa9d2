// SPDX-License-Identifier: BSD-3-Clause
// The strict parameter reader. No master: values are made here.
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "parameter_values.h"

namespace test_params {

namespace k = kurumaisu;
using namespace parameters;  // NOLINT: a test

namespace {

Value values() {
  Value v;
  v["rate"] = 50.0;
  v["count"] = 3;
  v["word"] = std::string("odom");
  v["on"] = true;
  v["exponent"] = std::string("1e-3");
  v["inner"]["x"] = 1.5;
  v["list"][0] = 1;
  v["list"][1] = 2.5;
  return v;
}

}  // namespace

TEST(Section, ReadsEachType) {
  k::Section section(values(), "/n");
  EXPECT_EQ(section.number("rate"), 50.0);
  EXPECT_EQ(section.number("count"), 3.0);  // an integer is a number
  EXPECT_EQ(section.choice("word", {"map", "odom"}), "odom");
  EXPECT_TRUE(section.flag("on"));
  EXPECT_EQ(section.numbers("list", 2), (std::vector<double>{1.0, 2.5}));
  k::Section inner = section.section("inner");
  EXPECT_EQ(inner.above("x", 0), 1.5);
  inner.end();
  EXPECT_EQ(section.names(), std::vector<std::string>{"exponent"});
  section.ignore("exponent");
  section.ignore("never there");
  section.end();
}

TEST(Section, NamesParameterAndValueOfWhatIsWrong) {
  k::Section s(values(), "/n");
  EXPECT_EQ(complaint([s]() mutable { s.number("rat"); }), "/n/rat: is missing");
  EXPECT_EQ(complaint([s]() mutable { s.end(); }), "/n/count: is not a known key; its value is 3");
  EXPECT_EQ(complaint([s]() mutable { s.number("word"); }),
            "/n/word: must be a number, not odom, a string (YAML wants 1.0e-3, not 1e-3)");
  EXPECT_NE(
      complaint([s]() mutable { s.number("exponent"); }).find("/n/exponent: must be a number, not 1e-3"),
      std::string::npos);
  EXPECT_NE(complaint([s]() mutable { s.number("on"); }).find("/n/on: must be a number"), std::string::npos);
  EXPECT_NE(complaint([s]() mutable { s.integer("rate", 0); }).find("/n/rate: must be an integer, not 50"),
            std::string::npos);
  EXPECT_EQ(complaint([s]() mutable { s.integer("count", 4); }), "/n/count: must be at least 4: 3");
  EXPECT_EQ(complaint([s]() mutable { s.above("rate", 50); }), "/n/rate: must be above 50: 50");
  EXPECT_EQ(complaint([s]() mutable { s.atLeast("rate", 51); }), "/n/rate: must be at least 51: 50");
  EXPECT_EQ(complaint([s]() mutable { s.choice("word", {"a", "b"}); }), "/n/word: must be one of a, b: odom");
  EXPECT_NE(complaint([s]() mutable { s.text("count"); }).find("/n/count: must be a string, not 3"),
            std::string::npos);
  EXPECT_NE(complaint([s]() mutable { s.flag("count"); }).find("/n/count: must be true or false, not 3"),
            std::string::npos);
  EXPECT_NE(complaint([s]() mutable { s.numbers("list", 3); }).find("/n/list: must be a list of 3 numbers"),
            std::string::npos);
  EXPECT_NE(complaint([s]() mutable { s.section("rate"); }).find("/n/rate: must be a mapping, not 50"),
            std::string::npos);
  EXPECT_EQ(complaint([s]() mutable { s.section("inner").end(); }),
            "/n/inner/x: is not a known key; its value is 1.5");
}

TEST(Section, AKeyIsReadOnce) {
  k::Section section(values(), "/n");
  section.number("rate");
  EXPECT_EQ(complaint([&section] { section.number("rate"); }), "/n/rate: is missing");
}

TEST(Section, WhatIsNotFiniteIsNoNumber) {
  for (const double bad :
       {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    Value value = values();
    value["rate"] = bad;
    value["list"][1] = bad;
    k::Section section(value, "/n");
    EXPECT_NE(complaint([&section] { section.number("rate"); }).find("/n/rate: must be finite"),
              std::string::npos);
    EXPECT_NE(complaint([&section] { section.numbers("list", 2); }).find("/n/list: must be finite"),
              std::string::npos);
  }
}

}  // namespace test_params
