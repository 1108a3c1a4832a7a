#include "hal/v4l2/v4l2_camera.hpp"

#include <fmt/format.h>

#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "hal/live/search_throttle.hpp"
#include "hal/v4l2/finder.hpp"
#include "hal/v4l2/modes.hpp"
#include "hal/v4l2/photometry.hpp"
#include "hal/v4l2/stream.hpp"

namespace dtact::hal::v4l2 {
namespace {

live::Opened open(const CameraConfig& config, const DeviceName& name, const PhotometricLock& lock) {
  DeviceName::Opened device = name.open(config.width, config.height);
  const std::uint32_t fourcc = choose(list_modes(device.fd.get()), config, device.identity);
  const auto stream =
      std::make_shared<Stream>(std::move(device.fd), device.node, fourcc, config, lock);
  stream->lock_controls();
  stream->start();
  std::vector<CameraControl> controls = stream->lock_controls_again();
  const CameraSettings settings = stream->settings(controls);
  return {stream, device.identity, find_format(fourcc)->name, std::move(controls), settings};
}

live::Opener opener(const CameraConfig& config) {
  check_pixel_format(config.v4l2.pixel_format);
  const std::string& range = config.v4l2.range;
  if (range != "auto" && range != "full" && range != "limited") {
    throw std::runtime_error(
        fmt::format("camera.v4l2.range = \"{}\": allowed are auto, full, limited", range));
  }
  const DeviceName name(config.v4l2.device);
  live::Opener open_named = [config, name, lock = PhotometricLock(config.v4l2)] {
    return open(config, name, lock);
  };
  // A path is tried without a look at other nodes.
  return name.is_path() ? open_named : live::paced(std::move(open_named));
}

}  // namespace

V4l2Camera::V4l2Camera(const CameraConfig& config)
    : LiveCamera(config, "v4l2", config.v4l2.device, opener(config)) {}

}  // namespace dtact::hal::v4l2
