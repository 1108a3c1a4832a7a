#pragma once

#include <sched.h>

#include <string>

#include "hal/base/unique_fd.hpp"

namespace dtact::base {

/// A CPU that this process claims for its real-time thread, so that several daemons on one machine
/// take different ones. The claim is an abstract Unix socket: it ends with the process, however
/// that ends. Other processes may still use the CPU.
class CpuClaim {
 public:
  /// Claims the last of `cpus` that is free; where each is claimed, the last of those with the
  /// fewest claims. `name`: claims are among processes that use the same one.
  explicit CpuClaim(const cpu_set_t& cpus, const std::string& name = "dtactd-capture");

  [[nodiscard]] int cpu() const noexcept { return cpu_; }

 private:
  int cpu_ = 0;
  UniqueFd claim_;
};

}  // namespace dtact::base
