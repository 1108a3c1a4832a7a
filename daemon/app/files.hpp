#pragma once

#include <filesystem>
#include <string>

#include "daemon/app/config.hpp"
#include "daemon/serve/net_config.hpp"
#include "hal/base/unique_fd.hpp"

namespace dtact::app {

/// Throws std::runtime_error, naming `key` and the fix, where this process may not read the file
/// or folder that the configuration names there.
void check_readable(const std::string& key, const std::filesystem::path& path);

/// The same of what the camera that is configured reads: a scene, a recording.
void check_camera_files(const hal::CameraConfig& camera);
/// The same, hal::check_devices() and pipeline::check_camera(): what a start would refuse without
/// opening a device.
void check_devices(const hal::Config& config);

/// The folder of the calibration to run with as long as none that was uploaded is current: the
/// configured one, or the simulated sensor's; empty = none.
[[nodiscard]] std::filesystem::path calibration_folder(const Config& config);
/// check_readable() of that folder, by the key that names it.
void check_calibration(const Config& config);
/// The folder for what outlives a restart.
[[nodiscard]] std::filesystem::path state_folder(const Config& config);
/// A calibration that was uploaded is current: a start takes it instead.
[[nodiscard]] bool has_uploaded_calibration(const Config& config);

/// Makes this process, the sensor `name`'s, the owner of the state folder as long as the descriptor
/// lives. Throws std::runtime_error, naming the present owner and the fix, where it has one.
[[nodiscard]] base::UniqueFd own_state_folder(const std::filesystem::path& folder,
                                              const std::string& name);

/// Puts the file that systemd handed in where certificate, key and token file are
/// "credential:NAME". Throws as resolve_credential().
void resolve_credentials(net::NetConfig& config);

/// Reads certificate, key and token file and discards them. Throws std::runtime_error with file
/// and fix where a start would throw and a reload would keep the old ones. Checks a credential if
/// this process has those of the unit.
void check_net_files(net::NetConfig config);

}  // namespace dtact::app
