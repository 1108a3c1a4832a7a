#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

namespace dtact::hal {

/// The simulated sensor.
struct SimConfig {
  std::filesystem::path scene;   ///< TOML scene; empty = the built-in default scene.
  std::uint64_t seed = 1;        ///< Noise and nothing else depends on it.
  std::string output = "mjpeg";  ///< "luma", "yuyv" or "mjpeg": the payload the HAL decodes.
  bool paced = true;             ///< false: a frame whenever one is asked for (tests, benchmarks).
};

/// Recorded frames.
struct ReplayConfig {
  std::filesystem::path folder;  ///< PNG or JPEG frames in the order of their names; or .mcap.
  bool loop = true;
  bool paced = true;  ///< false: as fast as they are asked for.
};

/// The photometric controls that V4l2Config::controls may name.
inline constexpr std::array kV4l2Controls{"auto_exposure",
                                          "exposure_dynamic_framerate",
                                          "gain_automatic",
                                          "white_balance_automatic",
                                          "focus_automatic_continuous",
                                          "power_line_frequency",
                                          "backlight_compensation",
                                          "exposure_time_absolute",
                                          "gain",
                                          "white_balance_temperature",
                                          "focus_absolute",
                                          "gamma",
                                          "contrast",
                                          "brightness",
                                          "saturation",
                                          "hue",
                                          "sharpness"};
/// Those that LibcameraConfig::controls may name.
inline constexpr std::array kLibcameraControls{"auto_exposure", "auto_white_balance", "auto_focus",
                                               "analogue_gain", "lens_position",      "brightness",
                                               "contrast",      "saturation",         "sharpness"};

/// A camera behind a V4L2 driver, as USB cameras are.
struct V4l2Config {
  /// The camera: a path below /dev/v4l/by-path or by-id, "serial:NUMBER", "bus:NAME" (the
  /// driver's bus_info), or a node like /dev/video0, whose number may change at every plug.
  /// Empty = the only camera on USB, or the only other one that delivers the size.
  std::string device;
  std::string pixel_format = "auto";  ///< "auto", "grey", "nv12", "yuyv" or "mjpeg".
  std::string range = "auto";  ///< For raw luma: "full", "limited", or "auto" = the driver's value.
  double exposure_us = 0;      ///< 0 = the camera's default.
  int exposure_pwm_periods = 0;  ///< Exposure as whole periods of the LEDs' PWM; 0 = not used.
  double pwm_hz = 0;             ///< The LEDs' PWM frequency, for exposure_pwm_periods.
  /// Photometric controls by their V4L2 names ("gain", "white_balance_temperature", ...), in the
  /// camera's own units. What is not named is locked at the camera's default.
  std::map<std::string, std::int64_t> controls;
};

/// A camera reached by libcamera, as CSI cameras are.
struct LibcameraConfig {
  std::string device;  ///< libcamera's id of the camera. Empty = the only camera attached.
  std::string pixel_format = "auto";  ///< "auto", "grey", "nv12", "yuv420", "yuyv" or "mjpeg".
  double exposure_us = 0;             ///< 0 = the camera's default.
  int exposure_pwm_periods = 0;       ///< As V4l2Config's.
  double pwm_hz = 0;                  ///< As V4l2Config's.
  /// "analogue_gain", "brightness", ... in libcamera's units. What is not named is locked at the
  /// camera's default.
  std::map<std::string, double> controls;
};

struct CameraConfig {
  std::string backend = "sim";  ///< A name the registry knows.
  int width = 800;              ///< Pixels.
  int height = 600;             ///< Pixels.
  double fps = 60;              ///< Frames a second.
  /// 1, 2 or 4: JPEG frames are decoded at 1/decode_scale of their size in each direction.
  int decode_scale = 1;
  SimConfig sim;
  ReplayConfig replay;
  V4l2Config v4l2;
  LibcameraConfig libcamera;
};

/// One line of a GPIO chip, by its offset or by its name; neither chip nor name = no line.
struct GpioLineConfig {
  std::string chip{};          ///< Path, name or label ("pinctrl-rp1").
  int line = -1;               ///< Offset on the chip.
  bool active_low = false;     ///< "on" is the low level.
  std::string name{};          ///< "GPIO17"; needs no chip while one line alone bears it.
  std::string bias = "as-is";  ///< Or "pull-up", "pull-down", "disabled".

  [[nodiscard]] bool is_set() const { return !chip.empty() || !name.empty(); }
};

/// A real ring of WS2812B.
struct Ws2812Config {
  /// light = colour × (brightness / 255)^gamma; 2.2: equal steps look equal, 1: proportional.
  double gamma = 2.2;
  double current_budget_ma = 500;  ///< What the ring may draw; a LED draws 1 … 60 mA.
  int resend_ms = 1000;            ///< A glitch heals after at most this long; 0 = never re-sent.
  bool leave_on = false;           ///< Keep the light when the program ends.
  int first_led = 0;      ///< Where the chain's first LED sits: 0 = 3 o'clock, then clockwise.
  bool clockwise = true;  ///< The way the chain runs on from there, as the camera sees it.

  std::string spi_device = "/dev/spidev0.0";
  int spi_hz = 3'200'000;
  int spi_bits = 4;            ///< SPI bits for each WS2812B bit: 3, 4 or 8.
  bool spi_check_rate = true;  ///< Measure the rate, time every transfer, refuse.

  std::string pio_device = "/dev/leds0";  ///< Device of a Raspberry Pi 5's ws2812-pio driver.

  GpioLineConfig power;      ///< Switches the ring's supply.
  int power_settle_ms = 50;  ///< From power on to the first write.
};

struct RingConfig {
  std::string backend = "sim";
  Ws2812Config ws2812;
};

struct Config {
  CameraConfig camera;
  RingConfig ring;
};

}  // namespace dtact::hal
