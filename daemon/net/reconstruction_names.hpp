#pragma once

#include <string>

#include "daemon/pipeline/pipeline_config.hpp"

namespace dtact::v1 {
class Reconstruction;
class SetReconstruction;
}  // namespace dtact::v1

namespace dtact::net {

/// Changes `rules` as `request` says; returns the sentence that says what is wrong with it, or an
/// empty one. Nothing has changed where something is wrong.
[[nodiscard]] std::string change(const v1::SetReconstruction& request,
                                 pipeline::ReconstructionRules& rules);
void fill(const pipeline::ReconstructionRules& rules, v1::Reconstruction& out);

}  // namespace dtact::net
