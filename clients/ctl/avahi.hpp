#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "clients/common/reports.pb.h"

namespace dtact::ctl {

/// Fills what the strings of a service's TXT record say ("key=value"); unknown keys are passed
/// over.
void read_txt(const std::vector<std::string>& txt, cli::FoundDaemon& to);

/// Every dtactd that this machine's avahi-daemon knows, one for each address, sorted by name. Ends
/// when Avahi reports all known ones, or at the time limit. Throws cli::Failure with a sentence
/// when no avahi-daemon runs.
[[nodiscard]] std::vector<cli::FoundDaemon> browse(std::chrono::milliseconds timeout);

}  // namespace dtact::ctl
