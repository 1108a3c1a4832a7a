#pragma once

#include <iosfwd>
#include <string>
#include <vector>

namespace dtact::calibrate {

/// The program dtact-calibrate, for main() and tests: runs the command that `arguments` (without
/// the program's own name) asks for. Returns an ExitCode.
[[nodiscard]] int run(const std::vector<std::string>& arguments, std::ostream& out,
                      std::ostream& error);

}  // namespace dtact::calibrate
