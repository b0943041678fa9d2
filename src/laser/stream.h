// SPDX-License-Identifier: BSD-3-Clause
// Between MRPT, which knows a plain sensor of so many beams, and the sensor, which is asked for a window, clusters and
// the scans that are wanted.
#pragma once

#include <mrpt/io/CStream.h>

#include <cstdint>
#include <exception>
#include <optional>
#include <string>

#include "laser/handshake.h"
#include "laser/link.h"
#include "scip/request.h"
#include "scip/scan.h"

namespace kurumaisu::laser {

/// What came from a sensor that streams.
struct Arrival {
  enum class Kind {
    kScan,       ///< whole and good
    kDamaged,    ///< a scan that is not
    kDuplicate,  ///< the scan before once more
    kStatus,     ///< the sensor's own report of trouble
  };
  Kind kind;
  scip::Rotation rotation;  ///< of kScan
  double first_byte = 0;    ///< [s] host's time
  std::string text;         ///< of the others: the status of kStatus, else what is wrong
};

/// A stream of whole, good replies. Neither Read nor Write throws through MRPT; rethrow() does.
class ScipStream : public mrpt::io::CStream {
 public:
  /// The link must outlive it. Throws std::invalid_argument for the short form, which MRPT does not know.
  ScipStream(Link& link, const Sensor& sensor, const scip::Request& request, double answer_timeout);

  /// Waits so long [s] for the sensor to send something. A scan then lies ready to be read.
  std::optional<Arrival> await(double timeout);

  /// What went wrong in Write, if anything did.
  void rethrow() const;

  /// Bytes of a reply in the form MRPT expects; never waits.
  std::size_t Read(void* buffer, std::size_t size) override;

  /// A command of MRPT's: carried out, or answered from what is known. Waits for the sensor's answer.
  std::size_t Write(const void* buffer, std::size_t size) override;

  std::uint64_t Seek(std::int64_t /*offset*/, TSeekOrigin /*origin*/) override { return 0; }
  std::uint64_t getTotalBytesCount() const override { return 0; }
  std::uint64_t getPosition() const override { return 0; }

 private:
  bool isDuplicate(const Arrival& arrival);
  void answer(const std::string& command);
  void start(const std::string& command);
  void put(const std::string& command, const std::string& status, const std::vector<std::string>& lines);
  std::vector<std::string> plainFan() const;

  Link& link_;
  const Sensor sensor_;
  const scip::Request request_;
  const double answer_timeout_;
  std::string started_;          // the command by which MRPT started scanning
  std::string ready_;            // bytes for MRPT
  std::size_t read_ = 0;         // of them
  std::optional<Arrival> last_;  // scan
  bool stands_ = false;          // the sensor's clock
  std::exception_ptr failure_;
};

}  // namespace kurumaisu::laser
