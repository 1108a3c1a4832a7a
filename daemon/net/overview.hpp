#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "daemon/pipeline/port.hpp"
#include "hal/base/machine.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {

/// What came of clients and went to them since start.
struct Traffic {
  std::uint64_t connections = 0;  ///< Accepted.
  std::uint64_t refused = 0;      ///< closed before authentication, part of the above
  std::uint64_t frames = 0;       ///< Sent.
  std::uint64_t dropped = 0;      ///< Frames that a client missed because it was slow.
  std::uint64_t bytes = 0;
};

/// All that the daemon says of itself: the wire's status, and what it has no field for.
struct Overview {
  v1::Status status;
  std::vector<pipeline::StageStatistics> stages;  ///< Those of `status`, with their counts.
  Traffic traffic;
  std::vector<base::Temperature> temperatures;     ///< Of the board, some seconds old at most.
  std::optional<std::int64_t> reference_taken_ns;  ///< See Hub::reference_taken_ns().
};

}  // namespace dtact::net
