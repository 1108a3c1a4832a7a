#include <stdexcept>

#include "hal/libcamera/libcamera_camera.hpp"

namespace dtact::hal::libcamera_backend {

void check(const CameraConfig& /*config*/) {
  throw std::runtime_error(
      "camera.backend = \"libcamera\": this program was built without libcamera; install "
      "libcamera-dev (0.0.3 or newer) and build it again");
}

std::unique_ptr<Camera> make_camera(const CameraConfig& config) {
  check(config);
  return nullptr;
}

}  // namespace dtact::hal::libcamera_backend
