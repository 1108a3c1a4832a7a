#pragma once

#include "clients/common/program.hpp"

namespace dtact::perceive {

/// The command "watch": what a running dtact-perceive sends, a line a second. Without --port it
/// asks dtact-perceive's own.
void add_watch(CLI::App& app, cli::Context& context);

}  // namespace dtact::perceive
