#pragma once

#include <iosfwd>
#include <vector>

#include "clients/ctl/online.hpp"
#include "hal/v4l2/survey.hpp"

namespace dtact::ctl {

/// cameras [--json]: what is attached to this machine, with the names to configure, the modes and
/// the controls. Needs no daemon; one that streams is not disturbed.
void add_cameras(CLI::App& app, Context& context);

/// What the command prints. On a `terminal`, nodes that are not taken are grey.
void print_cameras(const std::vector<hal::v4l2::SurveyedCamera>& cameras, bool json, bool terminal,
                   std::ostream& out);

}  // namespace dtact::ctl
