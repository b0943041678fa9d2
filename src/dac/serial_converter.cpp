// SPDX-License-Identifier: BSD-3-Clause
#include "dac/serial_converter.h"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <thread>
#include <utility>

#include "serial/tty.h"
#include "steady.h"

namespace kurumaisu::dac {
namespace {

constexpr const char* kWho = "DAC";  // the codes of errors begin so

}  // namespace

SerialConverter::SerialConverter(Channels channels, SerialSettings settings, OpenPort open_port)
    : channels_(channels), settings_(std::move(settings)), open_port_(std::move(open_port)) {
  if (!open_port_) {
    open_port_ = [this] { return std::make_unique<serial::Tty>(settings_.port, settings_.baud, kWho); };
  }
  openPort();
}

std::string SerialConverter::name() const {
  return "serial " + settings_.port + (identity_.empty() ? "" : ": " + identity_);
}

/// Gives the port up: after it was lost nothing is known of what is behind it.
Fault SerialConverter::lost(const std::string& what, const std::string& why) {
  dialogue_.reset();
  failed_ = false;
  return Fault(why + " (" + what + " of " + settings_.port + ")");
}

void SerialConverter::openPort() {
  greeted_ = prepared_ = false;
  try {
    dialogue_ = std::make_unique<Dialogue>(
        open_port_(), Manner{settings_.terminator, settings_.reply_terminator, settings_.reply_timeout,
                             settings_.late_reply, settings_.retries});
  } catch (const serial::LinkLost& error) {
    throw lost("start", error.what());
  }
  opened_ = steadyTime();
}

bool SerialConverter::prepare() {
  if (prepared_) return true;
  if (!dialogue_) throw Fault("DAC_CLOSED: " + settings_.port + " must be opened again");
  try {
    if (!greeted_ && !greet()) return false;
    start();
  } catch (const serial::LinkLost& error) {
    throw lost("start", error.what());
  } catch (const Fault& error) {
    settle();
    throw lost("start", error.what());
  }
  prepared_ = true;
  return true;
}

/// The first word; false if it must be said again, for the board may be booting.
bool SerialConverter::greet() {
  const double left = opened_ + settings_.boot - steadyTime();
  if (settings_.start.empty() || !settings_.start.front().answered) {  // nothing tells when it has booted
    if (left <= 0) return greeted_ = true;
    std::this_thread::sleep_for(std::chrono::duration<double>(std::min(left, settings_.reply_timeout)));
    return false;
  }
  const Exchange& first = settings_.start.front();
  try {
    const std::string reply = dialogue_->ask(first.send.plain(), first.expect.plain());
    if (settings_.identifies) identity_ = reply;
  } catch (const Fault&) {
    if (left <= 0) throw;
    return false;
  }
  dialogue_->settle();  // it may have kept what it was asked while it booted
  return greeted_ = true;
}

void SerialConverter::start() {
  const bool is_first_done = !settings_.start.empty() && settings_.start.front().answered;
  for (auto each = settings_.start.begin() + (is_first_done ? 1 : 0); each != settings_.start.end(); ++each) {
    if (each->answered) {
      dialogue_->ask(each->send.plain(), each->expect.plain());
    } else {
      dialogue_->tell(each->send.plain(), "");
    }
  }
}

/// Waits for what may still come, or it would be met by whoever opens the port next.
void SerialConverter::settle() {
  try {
    if (dialogue_) dialogue_->settle();
  } catch (const serial::LinkLost&) {
    dialogue_.reset();
  }
}

void SerialConverter::reopen() {
  settle();
  dialogue_.reset();
  openPort();
}

SerialConverter::Frames SerialConverter::framesOf(const Levels& levels) const {
  Fillings fillings;
  for (const Signal signal : kWriteOrder) fillings[signal] = {settings_.ch[signal], levels[signal]};
  const Exchange& write = settings_.write;
  if (settings_.one_frame)
    return {{"all channels", {write.send.fill(fillings), write.expect.fill(fillings)}}};
  Frames frames;
  for (const Signal signal : kWriteOrder) {
    const Filling& one = fillings[signal];
    frames.push_back({kSignalNames[signal], {write.send.fill(one), write.expect.fill(one)}});
  }
  return frames;
}

void SerialConverter::ask(const Frame& frame) {
  if (settings_.write.answered) {
    dialogue_->ask(frame.command.text, frame.command.expect);
  } else {
    dialogue_->tell(frame.command.text, "");
  }
}

/// Sends frames without waiting: what stops the chair must not.
void SerialConverter::tell(Frames::const_iterator frame, Frames::const_iterator end) {
  for (; frame != end; ++frame) dialogue_->tell(frame->command.text, frame->command.expect);
}

void SerialConverter::converse(Frames::const_iterator frame, Frames::const_iterator end) {
  const auto in_doubt = [this](const Frame& each) { return dialogue_->inDoubt(each.command.expect); };
  for (; frame != end; ++frame) {
    if (std::exchange(failed_, false) || std::any_of(frame, end, in_doubt)) {
      tell(frame, end);
      dialogue_->settle();
    }
    try {
      ask(*frame);
    } catch (const Fault& error) {
      failed_ = true;  // what comes next may be neutral: it is sent before anything is waited for
      tell(std::next(frame), end);
      throw Fault(std::string(error.what()) + " (" + frame->what + " of " + settings_.port + ")");
    }
  }
}

bool SerialConverter::putAtOnce(const Frames& frames) {
  std::vector<Dialogue::Command> commands;
  for (const Frame& frame : frames) commands.push_back(frame.command);
  return dialogue_->askAtOnce(commands);
}

Volts SerialConverter::put(const Volts& volts) {
  const Levels levels = levelsOf(volts, channels_, settings_.codings);
  if (!dialogue_ || !prepared_) throw Fault("DAC_CLOSED: " + settings_.port + " must be opened again");
  const Frames frames = framesOf(levels);
  try {
    if (!settings_.burst || !putAtOnce(frames)) converse(frames.begin(), frames.end());
  } catch (const serial::LinkLost& error) {
    throw lost("voltages", error.what());
  }
  return voltsOf(levels);
}

}  // namespace kurumaisu::dac
