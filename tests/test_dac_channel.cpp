// SPDX-License-Identifier: BSD-3-Clause
// Volts to codes: never beyond the clamp. Templates: against printf.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>

#include "dac/channel.h"
#include "dac/template.h"

namespace test_dac_channel {

namespace d = kurumaisu::dac;

namespace {

constexpr double kHuge = std::numeric_limits<double>::max();

double between(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// Any number, of any size, now and then none.
double anything(std::mt19937& random) {
  switch (random() % 8) {
    case 0:
      return between(random, -5, 5);
    case 1:
      return std::ldexp(between(random, -1, 1), static_cast<int>(random() % 2100) - 1060);
    case 2:
      return std::nan("");
    case 3:
      return random() % 2 == 0 ? HUGE_VAL : -HUGE_VAL;
    case 4:
      return random() % 2 == 0 ? kHuge : -kHuge;
    case 5:
      return -0.0;
    case 6:
      return std::numeric_limits<double>::denorm_min();
    default:
      return between(random, -0.01, 0.01);
  }
}

struct Wiring {
  d::Channels channels;
  d::Codings codings;
};

/// One that readDevice() would take.
Wiring anyWiring(std::mt19937& random) {
  for (;;) {
    Wiring wiring{};
    for (const d::Signal signal : d::kWriteOrder) {
      const bool is_reference = signal == d::kReference;
      const double low = is_reference ? between(random, 1, 3) : between(random, -2, 0);
      wiring.channels[signal] = {{low, is_reference ? low + between(random, 0.01, 1) : between(random, 0, 2)},
                                 !is_reference && random() % 2 == 0};
      const double per_volt = std::exp(between(random, 2, 9)) * (random() % 2 == 0 ? 1 : -1);
      const int min = random() % 3 == 0 ? -40000 : 0;
      wiring.codings[signal] = {per_volt, between(random, 0, 4000), min, 65535};
    }
    if (d::misfit(wiring.channels, wiring.codings).empty()) return wiring;
  }
}

void compareWithPrintf(const std::string& code_form, const std::string& volt_form, std::mt19937& random) {
  const std::string format = "<{%" + code_form + "|A7|%" + volt_form + "}>";
  const d::Template frame("<{{{code:" + code_form + "}|{ch}|{volt:" + volt_form + "}}}>",
                          d::Template::Kind::kChannel);
  const bool is_hex = code_form.find_first_of("xX") != std::string::npos;
  for (int i = 0; i < 400; ++i) {
    const int lowest = is_hex ? 0 : -70000;  // printf takes a negative one for something else
    const int code = std::uniform_int_distribution<int>(lowest, 70000)(random);
    const double volt = between(random, -12, 12) * (i % 9 == 0 ? 1e6 : 1);
    std::array<char, 200> expected{};
    std::snprintf(expected.data(), expected.size(), format.c_str(), code, volt);
    EXPECT_EQ(frame.fill(d::Filling{"A7", {code, volt, 0}}), expected.data());
  }
}

}  // namespace

TEST(DacChannel, NeverBeyondTheClamp) {
  std::mt19937 random(2);
  for (int i = 0; i < 100000; ++i) {
    const Wiring wiring = anyWiring(random);
    const d::Volts volts{anything(random), anything(random), anything(random)};
    const bool finite =
        std::isfinite(volts.translation) && std::isfinite(volts.steering) && std::isfinite(volts.reference);
    if (!finite) {
      EXPECT_THROW(d::levelsOf(volts, wiring.channels, wiring.codings), std::invalid_argument);
      continue;
    }
    const d::Levels levels = d::levelsOf(volts, wiring.channels, wiring.codings);
    double reference = 0;
    for (const d::Signal signal : d::kWriteOrder) {
      const d::Coding& coding = wiring.codings[signal];
      const d::Band& band = wiring.channels[signal].volt;
      const int code = levels[signal].code;
      EXPECT_TRUE(coding.min <= code && code <= coding.max) << code;
      const double pin = (code - coding.at_zero) / coding.per_volt;
      if (signal == d::kReference) reference = pin;
      const double volt = pin - (wiring.channels[signal].add_reference ? reference : 0);
      // by less than a code outside only where the codes end there
      const double slack = code == coding.min || code == coding.max ? 1 / std::abs(coding.per_volt) : 1e-9;
      EXPECT_TRUE(band.min - slack <= volt && volt <= band.max + slack)
          << band.min << " " << volt << " " << band.max;
      EXPECT_DOUBLE_EQ(volt, levels[signal].volt);
    }
  }
}

TEST(DacChannel, TheNearestCodeWithinTheClamp) {
  std::mt19937 random(3);
  for (int i = 0; i < 20000; ++i) {
    const Wiring wiring = anyWiring(random);
    const d::Volts volts{between(random, -2.5, 2.5), between(random, -2.5, 2.5), between(random, 0, 5)};
    const d::Levels levels = d::levelsOf(volts, wiring.channels, wiring.codings);
    const d::Coding& coding = wiring.codings[d::kReference];
    const d::Band& band = wiring.channels[d::kReference].volt;
    const double wanted = std::fmin(std::fmax(volts.reference, band.min), band.max);
    for (const int step : {-1, 1}) {
      const int other = levels[d::kReference].code + step;
      const double volt = (other - coding.at_zero) / coding.per_volt;
      if (volt < band.min || volt > band.max) continue;
      EXPECT_GE(std::abs(volt - wanted), std::abs(levels[d::kReference].volt - wanted) - 1e-9);
    }
  }
}

TEST(DacChannel, Misfits) {
  const d::Coding twelve{819, 0, 0, 4095};
  const d::Channel reference{{2.4, 2.6}, false};
  const d::Channel good{{-1, 1}, true};
  const auto misfit = [&](d::Channel translation, d::Coding coding) {
    return d::misfit({reference, translation, good}, {twelve, coding, twelve});
  };
  EXPECT_EQ(misfit(good, twelve), "");
  EXPECT_NE(misfit({{1, -1}, true}, twelve).find("min must be below"), std::string::npos);
  EXPECT_NE(misfit({{0.1, 1}, true}, twelve).find("neutral"), std::string::npos);
  EXPECT_NE(misfit({{-1, -0.1}, true}, twelve).find("neutral"), std::string::npos);
  EXPECT_NE(misfit({{-0.0005, 0.0005}, true}, twelve).find("narrower"), std::string::npos);
  EXPECT_NE(misfit({{-1, 2.5}, true}, twelve).find("codes from 0 to 4095"), std::string::npos)
      << "2.6 + 2.5 V of 5 V";
  EXPECT_NE(misfit({{-1, 1}, false}, twelve).find("codes"), std::string::npos) << "below 0 V";
  EXPECT_EQ(misfit({{-1, 1}, false}, {-819, 2048, 0, 4095}), "") << "an output that turns the sign";
}

TEST(DacTemplate, FillsInAsPrintfDoes) {
  std::mt19937 random(4);
  for (const char* code : {"d", "4d", "04d", "x", "X", "04X", "6x", "012d"}) {
    for (const char* volt : {".0f", ".3f", "+.3f", "8.2f", "+010.4f", "06.1f"})
      compareWithPrintf(code, volt, random);
  }
}

TEST(DacTemplate, RefusesWhatItDoesNotKnow) {
  using Kind = d::Template::Kind;
  for (const char* text : {"{",           "}",
                           "a{code",      "code}",
                           "{}",          "{Code}",
                           "{code:}",     "{code:s}",
                           "{code:04}",   "{code:.3f}",
                           "{code:+d}",   "{code:-4d}",
                           "{code:17d}",  "{code:99999999999999999999d}",
                           "{volt}",      "{volt:f}",
                           "{volt:.f}",   "{volt:.10f}",
                           "{volt:3f}",   "{volt:.3g}",
                           "{volt:.3fx}", "{ch:d}",
                           "{code:04X}}", "{reference.code}",
                           "{{code}",     "{code }"}) {
    EXPECT_THROW(d::Template(text, Kind::kChannel), std::invalid_argument) << text;
  }
  for (const char* text :
       {"{code}", "{ch}", "{other.code}", "{reference.}", "{.code}", "{reference}", "{reference.x}"}) {
    EXPECT_THROW(d::Template(text, Kind::kAll), std::invalid_argument) << text;
  }
  EXPECT_THROW(d::Template("{code}", Kind::kPlain), std::invalid_argument);
  EXPECT_EQ(d::Template("{{}} {{", Kind::kPlain).plain(), "{} {");
  EXPECT_EQ(d::Template("", Kind::kPlain).plain(), "");
}

}  // namespace test_dac_channel
