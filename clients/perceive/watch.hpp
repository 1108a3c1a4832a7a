#pragma once

#include <string>

#include "clients/common/program.hpp"
#include "proto/dtact.pb.h"

namespace dtact::perceive {

/// The command "watch": what a running dtact-perceive sends, a line a second. Without --port it
/// asks dtact-perceive's own.
void add_watch(CLI::App& app, cli::Context& context);

/// "58.1 fps  1.20 N +- 0.03  12,340 points in 0.21 ms  tracked: moved (1.02, 0.00, -0.10) mm,
/// ...": what a frame says in one line.
[[nodiscard]] std::string watch_line(const v1::Frame& frame, double fps);

}  // namespace dtact::perceive
