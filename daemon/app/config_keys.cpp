#include "daemon/app/config_keys.hpp"

#include <fmt/format.h>

#include <iterator>
#include <limits>
#include <utility>

#include "daemon/app/key_kinds.hpp"
#include "daemon/net/light_schemes.hpp"
#include "hal/files/key_reader.hpp"
#include "hal/registry.hpp"

namespace dtact::app {
namespace {

namespace fs = std::filesystem;
using Rules = pipeline::ReconstructionRules;

constexpr const char* kPwmUnit = "(Hz, 0 = not known)";
constexpr const char* kExposureUnit = "(microseconds, 0 = the camera's default)";
constexpr const char* kPeriodsUnit = "(periods, 0 = not used)";

void append_v4l2(hal::V4l2Config& c, std::vector<Key>& keys) {
  keys.push_back(text("camera.v4l2.device", c.device,
                      "a path below /dev, \"serial:NUMBER\", \"bus:NAME\", or \"\""));
  keys.push_back(choice("camera.v4l2.pixel_format", c.pixel_format,
                        {"auto", "grey", "nv12", "yuyv", "mjpeg"}));
  keys.push_back(choice("camera.v4l2.range", c.range, {"auto", "full", "limited"}));
  keys.push_back(real("camera.v4l2.exposure_us", c.exposure_us, 0, 1e6, kExposureUnit));
  keys.push_back(
      integer("camera.v4l2.exposure_pwm_periods", c.exposure_pwm_periods, 0, 1000, kPeriodsUnit));
  keys.push_back(real("camera.v4l2.pwm_hz", c.pwm_hz, 0, 1e5, kPwmUnit));
  for (const char* name : hal::kV4l2Controls) {
    keys.push_back(control("camera.v4l2.controls", name, c.controls));
  }
}

void append_libcamera(hal::LibcameraConfig& c, std::vector<Key>& keys) {
  keys.push_back(text("camera.libcamera.device", c.device, "libcamera's id of a camera, or \"\""));
  keys.push_back(choice("camera.libcamera.pixel_format", c.pixel_format,
                        {"auto", "grey", "nv12", "yuv420", "yuyv", "mjpeg"}));
  keys.push_back(real("camera.libcamera.exposure_us", c.exposure_us, 0, 1e6, kExposureUnit));
  keys.push_back(integer("camera.libcamera.exposure_pwm_periods", c.exposure_pwm_periods, 0, 1000,
                         kPeriodsUnit));
  keys.push_back(real("camera.libcamera.pwm_hz", c.pwm_hz, 0, 1e5, kPwmUnit));
  for (const char* name : hal::kLibcameraControls) {
    keys.push_back(control("camera.libcamera.controls", name, c.controls));
  }
}

/// LEDs by the name of a scheme.
Key scheme(std::string path, std::string& field) {
  return {std::move(path), fmt::format("one of {}", net::scheme_names()),
          [&field](const toml::node& node, const fs::path&) {
            const std::string name = node.value_or(std::string());
            if (!net::scheme_leds(name)) return false;
            field = name;
            return true;
          },
          [&field] { return tomlfile::quoted(field); }};
}

}  // namespace

std::vector<Key> bind_keys(Config& c) {
  constexpr const char* kChip = "a GPIO chip's path, name or label, or \"\"";
  hal::CameraConfig& camera = c.hal.camera;
  hal::Ws2812Config& ws2812 = c.hal.ring.ws2812;
  pipeline::PipelineConfig& p = c.pipeline;
  std::vector<Key> keys{
      choice("log_level", c.log_level, {"trace", "debug", "info", "warn", "error"}),
      path("calibration", c.calibration, "a folder with calibration.toml, or \"\""),
      path("state_dir", c.state_dir, "a folder, or \"\""),

      choice("camera.backend", camera.backend, hal::camera_backends()),
      integer("camera.width", camera.width, 16, 8192, "(pixels)"),
      integer("camera.height", camera.height, 16, 8192, "(pixels)"),
      real("camera.fps", camera.fps, 0.1, 1000, "(frames a second)"),
      one_of("camera.decode_scale", camera.decode_scale, {1, 2, 4}),
      optional_integer("camera.light_delay_frames", p.light_delay_frames, 0, 64, "(frames)"),
      path("camera.sim.scene", camera.sim.scene, "a scene file, or \"\" for the built-in one"),
      integer("camera.sim.seed", camera.sim.seed, 0, std::numeric_limits<std::int64_t>::max(), ""),
      choice("camera.sim.output", camera.sim.output, {"luma", "yuyv", "mjpeg"}),
      boolean("camera.sim.paced", camera.sim.paced),
      path("camera.sim.calibration", c.sim_calibration, "a folder with calibration.toml, or \"\""),
      path("camera.replay.folder", camera.replay.folder,
           "a folder with PNG or JPEG frames, or an .mcap file"),
      boolean("camera.replay.loop", camera.replay.loop),
      boolean("camera.replay.paced", camera.replay.paced),
  };
  append_v4l2(camera.v4l2, keys);
  append_libcamera(camera.libcamera, keys);
  std::vector<Key> rest{
      choice("ring.backend", c.hal.ring.backend, hal::ring_backends()),
      integer("ring.brightness", p.light.brightness, 0, 255, ""),
      scheme("ring.scheme", c.ring_scheme),
      real("ring.ws2812.gamma", ws2812.gamma, 0.2, 5, ""),
      real("ring.ws2812.current_budget_ma", ws2812.current_budget_ma, 8, 10000, "(milliamperes)"),
      integer("ring.ws2812.resend_ms", ws2812.resend_ms, 0, 3600000, "(milliseconds; 0 = never)"),
      boolean("ring.ws2812.leave_on", ws2812.leave_on),
      integer("ring.ws2812.first_led", ws2812.first_led, 0, hal::kLedCount - 1, ""),
      boolean("ring.ws2812.clockwise", ws2812.clockwise),
      text("ring.ws2812.spi_device", ws2812.spi_device, "a device such as \"/dev/spidev0.0\""),
      integer("ring.ws2812.spi_hz", ws2812.spi_hz, 1000000, 20000000, "(hertz)"),
      one_of("ring.ws2812.spi_bits", ws2812.spi_bits, {3, 4, 8}),
      boolean("ring.ws2812.spi_check_rate", ws2812.spi_check_rate),
      text("ring.ws2812.pio_device", ws2812.pio_device, "a device such as \"/dev/leds0\""),
      integer("ring.ws2812.power_settle_ms", ws2812.power_settle_ms, 0, 10000, "(milliseconds)"),
      text("ring.ws2812.power.chip", ws2812.power.chip, kChip),
      integer("ring.ws2812.power.line", ws2812.power.line, -1, 4095, "(offset on the chip)"),
      text("ring.ws2812.power.name", ws2812.power.name, "a GPIO line's name, or \"\""),
      boolean("ring.ws2812.power.active_low", ws2812.power.active_low),
      choice("ring.ws2812.power.bias", ws2812.power.bias,
             {"as-is", "pull-up", "pull-down", "disabled"}),

      optional_integer("capture.cpu", p.cpu, 0, 1023, ""),
      integer("capture.fifo_priority", p.fifo_priority, 0, 99, "(0 = normal scheduling)"),
      boolean("capture.lock_memory", p.lock_memory),

      named("reconstruction.resolution", p.reconstruction.decimation,
            {pipeline::kResolutionNames.begin(), pipeline::kResolutionNames.end()}),
      named_or("reconstruction.sharpen", p.reconstruction.sharpen,
               {pipeline::kSharpenNames.begin(), pipeline::kSharpenNames.end()}, {1, 2}),
      real("reconstruction.max_error_um", p.reconstruction.max_error_um, Rules::kMinErrorUm,
           Rules::kMaxErrorUm, "(micrometres)"),

      integer("reference.frames", p.reference.frames, 1, 256, "(frames)"),
      integer("reference.settle_frames", p.reference.settle_frames, 2, 64, "(frames)"),
      real("reference.settle_grey", p.reference.settle_grey, 0.01, 16, "(grey levels)"),
      integer("reference.timeout_frames", p.reference.timeout_frames, 10, 100000, "(frames)"),

      real("reference.drift_limit_percent", p.drift.limit_percent, 0, 5, "(percent; 0 = off)"),
      real("reference.drift_percent_per_minute", p.drift.percent_per_minute, 0.01, 60,
           "(percent a minute)"),

      real("contact.threshold_mm", p.contact.threshold_mm, 0.005, 5, "(millimetres)"),
      real("contact.release_mm", p.contact.release_mm, 0.001, 5, "(millimetres)"),
      real("contact.area_mm2", p.contact.area_mm2, 0.001, 1000, "(square millimetres)"),
      integer("contact.debounce_frames", p.contact.debounce_frames, 1, 1000, "(frames)"),
      integer("contact.beyond_pixels", p.beyond_pixels, 0, 1 << 26, "(pixels)"),

      text("net.address", c.net.address, "an IPv4 or IPv6 address in quotes, or \"\""),
      integer("net.port", c.net.port, 0, 65535, "(0 = any free one)"),
      boolean("net.listen_insecure", c.net.insecure),
      path("net.unix_socket", c.net.unix_socket, "a path for the socket, or \"\""),
      secret("net.tls_certificate", c.net.tls_certificate, "a PEM file, or \"\""),
      secret("net.tls_key", c.net.tls_key, "a PEM file, or \"\""),
      secret("net.tokens", c.net.token_file, "a file with a token on each line, or \"\""),
      integer("net.max_clients", c.net.max_clients, 1, 1024, ""),
      integer("net.max_clients_per_address", c.net.max_clients_per_address, 1, 1024, ""),
      integer("net.max_requests_per_s", c.net.max_requests_per_s, 1, 100000, "(requests a second)"),
      integer("net.fifo_priority", c.net.fifo_priority, 0, 99, "(0 = normal scheduling)"),
      text("net.frame_id", c.net.frame_id, "a name in quotes"),
      text("net.name", c.net.name, "a name in quotes"),
      milliseconds("net.hello_timeout_ms", c.net.hello_timeout, 100, 600000),
      milliseconds("net.peer_timeout_ms", c.net.peer_timeout, 1000, 600000),
      boolean("net.announce", c.announce),

      choice("metrics.address", c.metrics.address, {"127.0.0.1", "::1"}),
      integer("metrics.port", c.metrics.port, 0, 65535, "(0 = no metrics)"),
  };
  keys.insert(keys.end(), std::make_move_iterator(rest.begin()),
              std::make_move_iterator(rest.end()));
  return keys;
}

std::string why_gone(const std::string& path, const toml::node& value) {
  if (path == "ring.backend" && value.value_exact<std::string>() == "ws2812_gpio") {
    return "\"ws2812_gpio\" is gone: a program's pulses on a GPIO line last 13 … 15 µs where the "
           "LEDs allow 0.2 … 0.4; use ring.backend = \"ws2812_pio\" on a Raspberry Pi 5, else put "
           "the data line on an SPI controller's MOSI and set ring.backend = \"ws2812_spi\"";
  }
  if (path == "ring.ws2812.gpio_priority" || path == "ring.ws2812.gpio_retries" ||
      path == "ring.ws2812.data") {
    return "is gone, as ring.backend = \"ws2812_gpio\" is, the only one it was for: remove it";
  }
  return {};
}

}  // namespace dtact::app
