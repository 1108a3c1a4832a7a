#pragma once

#include <string>

namespace dtact::net {

/// Why a request is not done.
struct Refusal {
  int code = 0;  ///< dtact.v1.ErrorCode
  std::string sentence;
};

}  // namespace dtact::net
