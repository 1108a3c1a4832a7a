#pragma once

#include <string>

#include "proto/dtact.pb.h"

namespace dtact::ctl {

/// "resolution auto, sharpen off, within 50 um where that can be had".
[[nodiscard]] std::string text_of(const v1::Reconstruction& how);

}  // namespace dtact::ctl
