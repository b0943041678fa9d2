// SPDX-License-Identifier: BSD-3-Clause
#include "dac/template.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <optional>
#include <stdexcept>

namespace kurumaisu::dac {
namespace {

using Field = Template::Field;
using Part = Template::Part;

constexpr int kWidthMost = 16;
constexpr int kDigitsMost = 9;

[[noreturn]] void refuse(const std::string& field, const std::string& why) {
  throw std::invalid_argument("placeholder {" + field + "}: " + why);
}

/// Takes the characters at the front that are digits; nothing if there are none.
std::optional<int> takeNumber(std::string& spec) {
  int value = 0;
  const auto result = std::from_chars(spec.data(), spec.data() + spec.size(), value);
  if (result.ec != std::errc() || spec[0] == '-') return std::nullopt;
  spec.erase(0, static_cast<std::size_t>(result.ptr - spec.data()));
  return value;
}

bool take(std::string& spec, char character) {
  if (spec.empty() || spec[0] != character) return false;
  spec.erase(0, 1);
  return true;
}

void readSpec(Field& field, std::string spec, const std::string& whole) {
  const bool is_volt = field.what == Field::kVolt;
  field.plus = is_volt && take(spec, '+');
  field.zeros = take(spec, '0');
  field.width = takeNumber(spec).value_or(0);
  if (is_volt) {
    if (!take(spec, '.')) refuse(whole, "volt needs digits after the point, as {volt:.3f}");
    field.digits = takeNumber(spec).value_or(kDigitsMost + 1);
  }
  const std::string forms = is_volt ? "f" : "dxX";
  if (spec.size() != 1 || forms.find(spec) == std::string::npos) {
    refuse(whole, is_volt ? "volt is written as .3f or +06.3f" : "code is written as d, 04d, x or 04X");
  }
  field.form = spec[0];
  if (field.width > kWidthMost) refuse(whole, "is wider than " + std::to_string(kWidthMost));
  if (field.digits > kDigitsMost) refuse(whole, "needs 0 to " + std::to_string(kDigitsMost) + " digits");
}

Field::What whatOf(const std::string& name, const std::string& whole) {
  if (name == "ch") return Field::kCh;
  if (name == "code") return Field::kCode;
  if (name == "volt") return Field::kVolt;
  refuse(whole, "is unknown: ch, code and volt are known");
}

/// Takes "translation." off the front of a name.
int takeSignal(std::string& name, Template::Kind kind, const std::string& whole) {
  const std::size_t dot = name.find('.');
  if (kind == Template::Kind::kPlain) refuse(whole, "there is nothing to fill in here");
  if (kind == Template::Kind::kChannel) {
    if (dot != std::string::npos) refuse(whole, "the frame is for one channel: {code}, not {reference.code}");
    return Template::kThis;
  }
  for (const Signal signal : kWriteOrder) {
    if (name.substr(0, dot) == kSignalNames[signal] && dot != std::string::npos) {
      name.erase(0, dot + 1);
      return static_cast<int>(signal);
    }
  }
  refuse(whole, "the frame is for all channels: {reference.code}, {translation.volt:.3f}, {steering.code}");
}

Field readField(const std::string& whole, Template::Kind kind) {
  const std::size_t colon = whole.find(':');
  std::string name = whole.substr(0, colon);
  Field field{};
  field.signal = takeSignal(name, kind, whole);
  field.what = whatOf(name, whole);
  if (field.what == Field::kCh) {
    if (colon != std::string::npos) refuse(whole, "ch is written as it is");
    field.form = 's';
    return field;
  }
  const std::string spec = colon == std::string::npos ? "" : whole.substr(colon + 1);
  readSpec(field, colon == std::string::npos && field.what == Field::kCode ? "d" : spec, whole);
  return field;
}

/// Fills up between the sign and the digits, or before the sign.
std::string padded(std::string text, const Field& field) {
  const auto width = static_cast<std::size_t>(field.width);
  if (text.size() >= width) return text;
  const bool has_sign = text[0] == '-' || text[0] == '+';
  const std::size_t at = field.zeros && has_sign ? 1 : 0;
  return text.insert(at, width - text.size(), field.zeros ? '0' : ' ');
}

std::string codeText(int code, const Field& field) {
  std::array<char, 16> buffer{};
  const int base = field.form == 'd' ? 10 : 16;
  char* const end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), code, base).ptr;
  std::string text(buffer.data(), end);
  if (field.form == 'X') std::transform(text.begin(), text.end(), text.begin(), ::toupper);
  return padded(text, field);
}

std::string voltText(double volt, const Field& field) {
  std::array<char, 400> buffer{};  // any finite number fits
  char* const end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), volt,
                                  std::chars_format::fixed, field.digits)
                        .ptr;
  std::string text(buffer.data(), end);
  if (field.plus && text[0] != '-') text.insert(0, 1, '+');
  return padded(text, field);
}

std::string shown(const Field& field, const Filling& filling) {
  if (field.what == Field::kCh) return filling.ch;
  if (field.what == Field::kCode) return codeText(filling.level.code, field);
  return voltText(filling.level.pin, field);
}

void addText(std::vector<Part>& parts, char character) {
  if (parts.empty() || !std::holds_alternative<std::string>(parts.back())) parts.emplace_back(std::string());
  std::get<std::string>(parts.back()) += character;
}

}  // namespace

Template::Template(const std::string& text, Kind kind) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool twice = i + 1 < text.size() && text[i + 1] == text[i];
    if ((text[i] == '{' || text[i] == '}') && twice) {
      addText(parts_, text[i++]);
    } else if (text[i] == '{') {
      const std::size_t end = text.find('}', i);
      if (end == std::string::npos) throw std::invalid_argument("a { has no }; {{ stands for a brace");
      parts_.emplace_back(readField(text.substr(i + 1, end - i - 1), kind));
      i = end;
    } else if (text[i] == '}') {
      throw std::invalid_argument("a } has no {; }} stands for a brace");
    } else {
      addText(parts_, text[i]);
    }
  }
}

std::string Template::fill(const Filling& filling) const {
  std::string text;
  for (const Part& part : parts_) {
    const auto* field = std::get_if<Field>(&part);
    text += field == nullptr ? std::get<std::string>(part) : shown(*field, filling);
  }
  return text;
}

std::string Template::fill(const Fillings& fillings) const {
  std::string text;
  for (const Part& part : parts_) {
    const auto* field = std::get_if<Field>(&part);
    text += field == nullptr ? std::get<std::string>(part)
                             : shown(*field, fillings.at(static_cast<std::size_t>(field->signal)));
  }
  return text;
}

std::string Template::plain() const { return parts_.empty() ? "" : std::get<std::string>(parts_.front()); }

bool Template::tells(int signal) const {
  return std::any_of(parts_.begin(), parts_.end(), [signal](const Part& part) {
    const auto* field = std::get_if<Field>(&part);
    return field != nullptr && field->signal == signal && field->what != Field::kCh;
  });
}

bool Template::names() const {
  return std::any_of(parts_.begin(), parts_.end(), [](const Part& part) {
    const auto* field = std::get_if<Field>(&part);
    return field != nullptr && field->what == Field::kCh;
  });
}

void Template::checkWidth(int signal, const Coding& coding) const {
  for (const Part& part : parts_) {
    const auto* field = std::get_if<Field>(&part);
    if (field == nullptr || field->what != Field::kCode || field->signal != signal || field->width == 0)
      continue;
    for (const int code : {coding.min, coding.max}) {
      if (codeText(code, *field).size() > static_cast<std::size_t>(field->width)) {
        throw std::invalid_argument("code " + std::to_string(code) + " does not fit into " +
                                    std::to_string(field->width) + " characters");
      }
    }
  }
}

}  // namespace kurumaisu::dac
