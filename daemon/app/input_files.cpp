#include "daemon/app/input_files.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "daemon/app/service.hpp"

namespace dtact::app {

void check_readable(const std::string& key, const std::filesystem::path& path) {
  std::error_code ignored;
  const int rights = std::filesystem::is_directory(path, ignored) ? R_OK | X_OK : R_OK;
  if (path.empty() || ::access(path.c_str(), rights) == 0) return;
  const int error = errno;
  throw std::runtime_error(fmt::format(
      "{} = \"{}\": {}{}", key, path.string(), std::strerror(error),
      under_systemd() ? "; the service sees nothing in /home, /root and /tmp: put it into "
                        "/etc/dtactd, readable to the user dtactd"
                      : ""));
}

void check_camera_files(const hal::CameraConfig& camera) {
  if (camera.backend == "sim") check_readable("camera.sim.scene", camera.sim.scene);
  if (camera.backend == "replay") check_readable("camera.replay.folder", camera.replay.folder);
}

}  // namespace dtact::app
