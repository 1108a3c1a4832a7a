#pragma once

#include <sstream>
#include <string>
#include <vector>

#include "clients/ctl/ctl.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::ctl::test {

/// What dtactctl returned and printed.
struct Result {
  int code = 0;
  std::string out;
  std::string error;
};

inline Result ctl(const std::vector<std::string>& arguments) {
  std::ostringstream out;
  std::ostringstream error;
  const int code = run(arguments, out, error);
  return {code, out.str(), error.str()};
}

/// With the rig's port.
inline Result ctl(const net::test::Rig& rig, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {"--port", std::to_string(rig.tcp_port())});
  return ctl(arguments);
}

}  // namespace dtact::ctl::test
