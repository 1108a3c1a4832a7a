#pragma once

#include "clients/common/program.hpp"

// What a daemon that other machines reach needs: a certificate and tokens. Neither command needs a
// daemon.
namespace dtact::ctl {

using cli::Context;

void add_cert(CLI::App& app, Context& context);
void add_token(CLI::App& app, Context& context);

}  // namespace dtact::ctl
