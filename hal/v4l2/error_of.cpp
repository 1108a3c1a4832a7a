#include "hal/v4l2/error_of.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>

namespace dtact::hal::v4l2 {

DeviceError error_of(int error, const std::string& what, const std::string& node) {
  switch (error) {
    case EBUSY:
      return {CameraState::busy,
              fmt::format("another program uses {}: end it (fuser -v {} names it)", node, node)};
    case ENOSPC:
      return {CameraState::busy,
              fmt::format("the USB bus of {} has no bandwidth left: plug the camera into another "
                          "controller, or choose the pixel format mjpeg or a lower rate",
                          node)};
    case EACCES:
    case EPERM:
      return {CameraState::denied,
              fmt::format("no permission to open {}: add the daemon's user to the group video "
                          "(usermod -aG video USER) and start it again",
                          node)};
    default:
      return {CameraState::unplugged, fmt::format("cannot {} {} ({}): plug the camera in again",
                                                  what, node, std::strerror(error))};
  }
}

}  // namespace dtact::hal::v4l2
