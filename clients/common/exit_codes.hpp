#pragma once

#include <stdexcept>
#include <string>

namespace dtact::cli {

/// What the programs return to the shell; `--help` prints kExitCodesHelp.
enum ExitCode : int {
  kOk = 0,
  kFailed = 1,        ///< The command failed or the daemon refused it.
  kUsage = 2,         ///< The command line makes no sense.
  kNoConnection = 3,  ///< No daemon, or the connection broke.
  kNotMet = 4         ///< What was asked for did not come about; kExitCodesHelp lists the cases.
};

inline constexpr const char* kExitCodesHelp =
    "Exit codes: 0 done; 1 failed, or refused by the daemon; 2 wrong usage; 3 no connection to\n"
    "the daemon; 4 what was asked for did not come about (dtactctl watch --min-fps: too few\n"
    "frames; bench: no frame; find, fleet: no daemon; setup: a step is not done;\n"
    "dtact-calibrate guided: ended without a calibration).";

/// A failure with an exit code of its own. Any other exception ends the program with kFailed.
class Failure : public std::runtime_error {
 public:
  Failure(ExitCode code, const std::string& sentence) : std::runtime_error(sentence), code_(code) {}
  [[nodiscard]] ExitCode code() const noexcept { return code_; }

 private:
  ExitCode code_;
};

}  // namespace dtact::cli
