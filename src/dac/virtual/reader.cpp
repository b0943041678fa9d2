// SPDX-License-Identifier: BSD-3-Clause
#include "dac/virtual/reader.h"

#include <fnmatch.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace kurumaisu::dac {
namespace {

using Field = Template::Field;

std::string escaped(const std::string& text) {
  std::string result;
  for (const char character : text) {
    if (std::string("^$\\.*+?()[]{}|").find(character) != std::string::npos) result += '\\';
    result += character;
  }
  return result;
}

std::string formOf(const Field& field, const SerialSettings& settings) {
  if (field.what == Field::kVolt) {
    return R"(( *[-+]?[0-9]+)" + (field.digits > 0 ? "\\.[0-9]{" + std::to_string(field.digits) + "})" : ")");
  }
  if (field.what == Field::kCode) {  // one of a fixed width has no more: Template::checkWidth()
    const std::string digits = field.form == 'd' ? "[ 0-9-]" : "[ 0-9a-fA-F-]";
    return "(" + digits + (field.width > 0 ? "{" + std::to_string(field.width) + "})" : "+)");
  }
  if (field.signal != Template::kThis) return escaped(settings.ch.at(static_cast<std::size_t>(field.signal)));
  std::string choices;
  for (const std::string& ch : settings.ch) choices += (choices.empty() ? "" : "|") + escaped(ch);
  return "(" + choices + ")";
}

/// Does the regular expression take the field as a group?
bool isGroup(const Field& field) { return field.what != Field::kCh || field.signal == Template::kThis; }

int codeOf(const std::string& text, const Field& field, const Coding& coding) {
  if (field.what == Field::kCode) return std::stoi(text, nullptr, field.form == 'd' ? 10 : 16);
  return static_cast<int>(std::lround(coding.per_volt * std::stod(text) + coding.at_zero));
}

/// A text that a shell pattern matches.
std::string sampleOf(const std::string& pattern) {
  std::string sample;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    if (pattern[i] == '*') continue;
    if (pattern[i] == '[' && pattern.find(']', i + 2) != std::string::npos) {
      sample += pattern[i + 1];
      i = pattern.find(']', i + 2);
    } else {
      sample += pattern[i] == '?' ? '0' : pattern[i];
    }
  }
  if (fnmatch(pattern.c_str(), sample.c_str(), FNM_NOESCAPE) == 0) return sample;
  throw std::invalid_argument("the virtual board cannot make up a reply to match " + pattern);
}

}  // namespace

BoardReader::BoardReader(const SerialSettings& settings) : settings_(settings) {
  std::string form;
  for (const Template::Part& part : settings_.write.send.parts()) {
    const auto* field = std::get_if<Field>(&part);
    form += field == nullptr ? escaped(std::get<std::string>(part)) : formOf(*field, settings_);
  }
  form_ = std::regex(form);
  for (const Exchange& each : settings_.start) sampleOf(each.expect.plain());
}

std::optional<BoardReader::Heard> BoardReader::hear(const std::string& line, bool lost) const {
  for (const Exchange& each : settings_.start) {
    if (line == each.send.plain()) return Heard{sampleOf(each.expect.plain()), {}};
  }
  try {
    return hearWrite(line, lost);
  } catch (const std::logic_error&) {
    return std::nullopt;  // no number
  }
}

std::optional<BoardReader::Heard> BoardReader::hearWrite(const std::string& line, bool lost) const {
  std::smatch match;
  if (line.size() > 500 || !std::regex_match(line, match, form_)) return std::nullopt;
  int current = kReference;
  Fillings fillings{};
  for (const Signal signal : kWriteOrder) fillings[signal].ch = settings_.ch[signal];
  Heard heard;
  std::size_t group = 0;
  for (const Template::Part& part : settings_.write.send.parts()) {
    const auto* field = std::get_if<Field>(&part);
    if (field == nullptr || !isGroup(*field)) continue;
    const std::string text = match[++group];
    if (field->what == Field::kCh) {
      current =
          static_cast<int>(std::find(settings_.ch.begin(), settings_.ch.end(), text) - settings_.ch.begin());
      continue;
    }
    const auto signal = static_cast<Signal>(field->signal == Template::kThis ? current : field->signal);
    const Coding& coding = settings_.codings[signal];
    const int code = lost ? coding.min : codeOf(text, *field, coding);
    if (code < coding.min || code > coding.max) return std::nullopt;
    heard.codes.emplace_back(signal, code);
    fillings[signal].level = {code, (code - coding.at_zero) / coding.per_volt, 0};
  }
  const Template& expect = settings_.write.expect;
  const auto one = static_cast<std::size_t>(current);
  heard.reply = sampleOf(settings_.one_frame ? expect.fill(fillings) : expect.fill(fillings.at(one)));
  return heard;
}

}  // namespace kurumaisu::dac
