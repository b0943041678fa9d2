// SPDX-License-Identifier: BSD-3-Clause
// A D/A board that is told by text over a tty.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "dac/converter.h"
#include "dac/dialogue.h"
#include "dac/settings.h"

namespace kurumaisu::dac {

/// put() sends every frame even if one before it was not confirmed, for it may be the one that stops the chair.
///
/// A frame goes out when the one before is confirmed, or found not to be, after (1 + retries) * reply_timeout. In a burst,
/// and after a fault, all of them go out at once; a burst that is not confirmed is repeated frame by frame. It returns within that and late_reply, for each frame.
class SerialConverter : public Converter {
 public:
  using OpenPort = std::function<std::unique_ptr<serial::Port>()>;

  /// Opens the port for this program alone. open_port: a tty by default. Throws Fault.
  SerialConverter(Channels channels, SerialSettings settings, OpenPort open_port = {});

  /// Identifies the board and sends what comes before the first voltage, but no voltage. Many boards start anew when
  /// their port is opened: what they do not answer is asked again until `boot` is over.
  bool prepare() override;

  Volts put(const Volts& volts) override;
  void reopen() override;
  std::string name() const override;

 private:
  struct Frame {
    std::string what;  // for messages
    Dialogue::Command command;
  };

  using Frames = std::vector<Frame>;

  Frames framesOf(const Levels& levels) const;
  bool putAtOnce(const Frames& frames);
  void openPort();
  bool greet();
  void start();
  void settle();
  void converse(Frames::const_iterator frame, Frames::const_iterator end);
  void tell(Frames::const_iterator frame, Frames::const_iterator end);
  void ask(const Frame& frame);
  Fault lost(const std::string& what, const std::string& why);

  Channels channels_;
  SerialSettings settings_;
  OpenPort open_port_;
  std::unique_ptr<Dialogue> dialogue_;  // none while the port is lost
  std::string identity_;
  double opened_ = 0;      // [s] steady
  bool greeted_ = false;   // the first of what comes before the first voltage is done
  bool prepared_ = false;  // all of it is
  bool failed_ = false;    // at the last put
};

}  // namespace kurumaisu::dac
