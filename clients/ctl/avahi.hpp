#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "clients/common/reports.pb.h"

namespace dtact::ctl {

/// Fills what the strings of a service's TXT record say ("key=value"); unknown keys are passed
/// over.
void read_txt(const std::vector<std::string>& txt, cli::FoundDaemon& to);

/// Every dtactd that this machine's avahi-daemon knows of, one for each address, by name; looks
/// until Avahi says that it has all for now, at most for so long. Throws cli::Failure with a
/// sentence when there is no avahi-daemon to ask.
[[nodiscard]] std::vector<cli::FoundDaemon> browse(std::chrono::milliseconds timeout);

}  // namespace dtact::ctl
