// SPDX-License-Identifier: BSD-3-Clause
// dynamic_reconfigure for the sets of limits, each under its name in ~limits.
#pragma once

#include <dynamic_reconfigure/server.h>
#include <kurumaisu/BaseConfig.h>

#include <memory>
#include <string>
#include <vector>

#include "base/drive.h"

namespace kurumaisu {

class LimitsServer {
 public:
  /// drive must outlive this object.
  LimitsServer(const std::vector<std::string>& names, Drive& drive);

 private:
  struct Set {
    boost::recursive_mutex mutex;
    std::unique_ptr<dynamic_reconfigure::Server<BaseConfig>> server;
  };

  void reconfigure(std::size_t set, BaseConfig& wanted);

  Drive& drive_;
  std::vector<std::unique_ptr<Set>> sets_;
};

}  // namespace kurumaisu
