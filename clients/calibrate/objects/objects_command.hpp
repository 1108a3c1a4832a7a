#pragma once

#include "clients/common/program.hpp"

namespace dtact::objects {

/// objects teach|list|rename|forget --taught FOLDER: objects that dtact-perceive recognises beside
/// the built-in ones; objects evaluate FOLDER: how well objects can be distinguished.
void add_objects(CLI::App& app, cli::Context& context);

}  // namespace dtact::objects
