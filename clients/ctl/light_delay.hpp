#pragma once

#include "clients/common/program.hpp"

namespace dtact::ctl {

/// Steps the brightness down and up several times, sees after how many frames the picture has
/// followed, and prints that with the line for the configuration. The light is as before
/// afterwards, also after Ctrl-C. Throws cli::Failure saying what to do where nothing can be
/// measured.
void measure_light_delay(const cli::Context& context);

}  // namespace dtact::ctl
