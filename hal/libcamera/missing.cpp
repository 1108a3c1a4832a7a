#include <stdexcept>

#include "hal/libcamera/libcamera_camera.hpp"

namespace dtact::hal::libcamera_backend {

std::unique_ptr<Camera> make_camera(const CameraConfig& /*config*/) {
  throw std::runtime_error(
      "camera.backend = \"libcamera\": this program was built without libcamera; install "
      "libcamera-dev (0.0.3 or newer) and build it again");
}

}  // namespace dtact::hal::libcamera_backend
