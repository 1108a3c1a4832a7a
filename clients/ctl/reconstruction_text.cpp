#include "clients/ctl/reconstruction_text.hpp"

#include <fmt/format.h>

namespace dtact::ctl {

std::string text_of(const v1::Reconstruction& how) {
  std::string text = fmt::format("resolution {}, sharpen {}", how.resolution(), how.sharpen());
  if (how.resolution() == "auto" || how.sharpen() == "auto") {
    text += fmt::format(", within {:g} um where that can be had", how.max_error_um());
  }
  return text;
}

}  // namespace dtact::ctl
