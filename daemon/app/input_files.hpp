#pragma once

#include <filesystem>
#include <string>

#include "daemon/app/config.hpp"

namespace dtact::app {

/// Throws std::runtime_error, naming `key` and the remedy, where this process may not read the file
/// or folder that the configuration names there.
void check_readable(const std::string& key, const std::filesystem::path& path);

/// The same of what the camera that is configured reads: a scene, a recording.
void check_camera_files(const hal::CameraConfig& camera);

}  // namespace dtact::app
