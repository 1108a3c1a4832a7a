#pragma once

#include <string>

namespace dtact::cli {

/// Where another program of the same release lies: beside this one, else its name alone, for PATH.
[[nodiscard]] std::string sibling(const std::string& program);

}  // namespace dtact::cli
