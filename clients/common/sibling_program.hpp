#pragma once

#include <string>

namespace dtact::cli {

/// The folder that this program lies in; empty: not known.
[[nodiscard]] std::string own_folder();

/// Where another program of the same release lies: beside this one, else its name alone, for PATH.
[[nodiscard]] std::string sibling(const std::string& program);

}  // namespace dtact::cli
