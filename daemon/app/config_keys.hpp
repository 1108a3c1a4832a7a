#pragma once

#include <toml++/toml.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "daemon/app/config.hpp"

namespace dtact::app {

/// One key of the configuration: how to set it and how to show it.
struct Key {
  std::string path;     ///< "camera.width"
  std::string allowed;  ///< What a value must be, in words: "a whole number, 16 … 4096 (pixels)".
  /// Sets the value; false when its type or range is wrong. Relative paths start at `folder`.
  std::function<bool(const toml::node& value, const std::filesystem::path& folder)> assign;
  std::function<std::string()> show;  ///< The present value as TOML.
};

/// Every key there is, bound to the fields of `config`, in the order of config/dtactd.toml.
[[nodiscard]] std::vector<Key> bind_keys(Config& config);

/// Why a key or table, or this value of it, that older files have is gone, and what to do; empty
/// for all others.
[[nodiscard]] std::string why_gone(const std::string& path, const toml::node& value);

}  // namespace dtact::app
