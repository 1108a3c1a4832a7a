#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "daemon/app/doctor/checks.hpp"
#include "hal/ws2812/encoder.hpp"
#include "hal/ws2812/spi_wire.hpp"

namespace dtact::app {
namespace {

std::string join_group(const Machine& machine, const std::string& path,
                       const std::string& usual_group) {
  const std::string owner = machine.group(path);
  // Without a rule of udev's the node belongs to root: the rule first, then the group.
  const std::string copied = machine.has("/usr/lib/udev/rules.d/60-dtactd.rules")
                                 ? ""
                                 : "sudo cp config/udev/60-dtactd.rules /etc/udev/rules.d/ && ";
  const std::string rule =
      owner.empty() || owner == "root"
          ? copied + "sudo udevadm control --reload && sudo udevadm trigger && "
          : "";
  return fmt::format(
      "{}sudo usermod -aG {} {}{}", rule, owner.empty() || owner == "root" ? usual_group : owner,
      machine.user(),
      machine.user() == kServiceUser ? " && sudo systemctl restart dtactd" : ", then log in again");
}

/// Whether a camera has this name: "serial:NUMBER" or "bus:NAME".
bool is_attached(const Machine& machine, const std::string& name) {
  const std::vector<hal::v4l2::SurveyedCamera> cameras = machine.cameras();
  return std::ranges::any_of(cameras, [&](const hal::v4l2::SurveyedCamera& camera) {
    return name == "serial:" + camera.attached.serial || name == "bus:" + camera.attached.bus;
  });
}

bool is_raspberry_pi(const Machine& machine) { return machine.model().starts_with("Raspberry Pi"); }

/// The first with an RP1.
bool is_raspberry_pi_5(const Machine& machine) {
  return machine.model().find("Pi 5") != std::string::npos ||
         machine.model().find("Module 5") != std::string::npos;
}

/// The names of libcamera's modules, wherever a version of it looks for them.
std::vector<std::string> ipa_modules(const Machine& machine) {
  std::vector<std::string> names;
  for (const char* libraries : {"/usr/lib", "/usr/local/lib"}) {
    for (const std::string& architecture : machine.list(libraries, "")) {
      for (const char* folder : {"/libcamera", "/libcamera/ipa"}) {
        for (const std::string& module : machine.list(architecture + folder, "ipa_")) {
          if (module.ends_with(".so")) names.push_back(module.substr(module.rfind('/') + 1));
        }
      }
    }
  }
  return names;
}

Finding check_line(const Machine& machine, const std::string& key,
                   const hal::GpioLineConfig& line) {
  const std::string what = fmt::format("{}: {}", key, hal::gpiod::describe(line));
  const hal::gpiod::Place place = hal::gpiod::find_line(machine.gpio_chips(), line, key);
  if (!place.why.empty()) {
    return {Verdict::wrong, fmt::format("{}: {}", what, place.why), place.fix};
  }
  const std::string holder = machine.gpio_holder(place.chip, place.line);
  if (holder == hal::gpiod::holder_name(hal::gpiod::kConsumer)) {
    return {Verdict::note,
            fmt::format("{}: in use by {}, as it is while the service runs", what, holder),
            "if none runs with this configuration, another has the line: systemctl list-units "
            "'dtactd*'"};
  }
  if (!holder.empty()) {
    return {Verdict::wrong, fmt::format("{}: in use by {}", what, holder),
            fmt::format("free it, or choose a free line: gpioinfo {}", place.chip)};
  }
  return {Verdict::good, what + " is free", ""};
}

}  // namespace

Findings check_camera(const Machine& machine, const hal::CameraConfig& camera) {
  const bool needed = camera.backend == "v4l2" || camera.backend == "libcamera";
  const Verdict bad = needed ? Verdict::wrong : Verdict::note;
  const std::vector<std::string> nodes = machine.list("/dev", "video");
  if (nodes.empty()) {
    if (!needed) {
      return {{Verdict::good, fmt::format("camera.backend = \"{}\" needs no node", camera.backend),
               ""}};
    }
    return {{bad, "no camera node (/dev/video*)",
             "plug the camera in and see lsusb and dmesg; sudo modprobe uvcvideo"}};
  }
  Findings findings;
  bool captures = false;
  bool usb = false;
  for (const std::string& node : nodes) {
    if (const int error = machine.access(node); error != 0) {
      findings.push_back({bad, fmt::format("{}: {}", node, std::strerror(error)),
                          join_group(machine, node, "video")});
      continue;
    }
    const Machine::Video video = machine.video(node);
    if (video.error != 0) {
      findings.push_back(
          {Verdict::note, fmt::format("{}: {}", node, std::strerror(video.error)), "dmesg | tail"});
    } else if (video.captures) {
      captures = true;
      usb = usb || video.usb;
      findings.push_back({Verdict::good,
                          fmt::format("{} \"{}\" captures{}", node, video.card,
                                      video.usb ? "" : ", on no USB port"),
                          ""});
    }  // Metadata nodes are not relevant.
  }
  if (!captures && findings.empty()) {
    findings.push_back({bad, "no video node captures", "v4l2-ctl --list-devices"});
  }
  // Another camera does not make up for the one that is meant.
  const std::string& device = camera.v4l2.device;
  if (camera.backend == "v4l2" && device.starts_with("/dev/")) {
    if (const int error = machine.access(device); error != 0) {
      findings.push_back(
          {bad, fmt::format("camera.v4l2.device = \"{}\": {}", device, std::strerror(error)),
           error == ENOENT ? "plug it in, or take a name that dtactctl cameras shows"
                           : join_group(machine, device, "video")});
    }
  } else if (camera.backend == "v4l2" && !device.empty() && !is_attached(machine, device)) {
    // The name may be a serial number, which a report leaves out.
    findings.push_back(
        {bad, "the camera that camera.v4l2.device names is not attached",
         fmt::format("plug {} in, or take a name that dtactctl cameras shows", device)});
  }
  // A Raspberry Pi 4 has these nodes for its image processor without any camera (bcm2835-isp).
  if (captures && !usb && camera.backend == "v4l2" && camera.v4l2.device.empty()) {
    findings.push_back({Verdict::note, "none of them is a USB camera",
                        "lsusb, then dtactctl cameras and camera.v4l2.device"});
  }
  return findings;
}

Findings check_usb_speed(const Machine& machine, const hal::CameraConfig& camera) {
  Findings findings;
  if (camera.backend != "v4l2") return findings;
  // What an isochronous endpoint carries at high speed: three packets of 1024 bytes in each of 8000
  // microframes a second (USB 2.0 specification, 5.6.3 and 5.9.2).
  constexpr double kHighSpeedBytes = 3 * 1024 * 8000;
  const double bytes_per_pixel = camera.v4l2.pixel_format == "grey"   ? 1
                                 : camera.v4l2.pixel_format == "nv12" ? 1.5
                                 : camera.v4l2.pixel_format == "yuyv" ? 2
                                                                      : 0;  // "auto", "mjpeg"
  const double need = camera.fps * camera.width * camera.height * bytes_per_pixel;
  for (const std::string& node : machine.list("/dev", "video")) {
    const std::string name = node.substr(node.rfind('/') + 1);
    // The node's device is an interface of the USB device, which knows the speed.
    const auto speed = machine.line("/sys/class/video4linux/" + name + "/device/../speed");
    if (!speed || !machine.video(node).captures) continue;
    const double megabits = std::strtod(speed->c_str(), nullptr);
    const std::string what = fmt::format("{} is on a port of {} Mbit/s", node, *speed);
    if (megabits < 480) {
      findings.push_back({Verdict::wrong, what + ": too slow for a stream of pictures",
                          "lsusb -t, then another port or cable, and no hub between"});
    } else if (megabits < 5000 && need > kHighSpeedBytes) {
      findings.push_back(
          {Verdict::note,
           fmt::format("{}, which carries up to {:.1f} MB/s; {} at {}x{} and {:g} fps needs {:.1f}",
                       what, kHighSpeedBytes / 1e6, camera.v4l2.pixel_format, camera.width,
                       camera.height, camera.fps, need / 1e6),
           "set camera.v4l2.pixel_format = \"mjpeg\", or lsusb -t and a USB 3 port"});
    } else {
      findings.push_back({Verdict::good, what, ""});
    }
  }
  return findings;
}

Findings check_dma_heap(const Machine& machine, const hal::CameraConfig& camera) {
  if (camera.backend != "libcamera") return {};
  const std::string folder = "/dev/dma_heap";
  std::string denied;
  for (const std::string& heap : machine.list(folder, "")) {
    if (machine.access(heap) == 0) return {{Verdict::good, heap + " may be opened", ""}};
    denied = heap;
  }
  // libcamera's PipelineHandlerVc4::platformRegister() returns ENOMEM without a heap; other
  // pipelines allocate elsewhere, on some machines in uncached memory.
  const bool needed = is_raspberry_pi(machine);
  const Verdict bad = needed ? Verdict::wrong : Verdict::note;
  const std::string cost =
      needed ? "libcamera opens no camera" : "frames may lie in memory that is slow to read";
  if (!denied.empty()) {
    return {{bad, denied + " may not be opened: " + cost, join_group(machine, denied, "video")}};
  }
  return {{bad, fmt::format("no heap in {}: {}", folder, cost),
           "a kernel with CONFIG_DMABUF_HEAPS (Raspberry Pi OS has it): ls " + folder}};
}

Findings check_ipa(const Machine& machine, const hal::CameraConfig& camera) {
  if (camera.backend != "libcamera") return {};
  const std::vector<std::string> modules = ipa_modules(machine);
  // Other pipelines do without, the one of USB cameras among them.
  const Verdict bad = is_raspberry_pi(machine) ? Verdict::wrong : Verdict::note;
  if (modules.empty()) {
    return {{bad, "none of libcamera's modules (ipa_*.so): it finds no CSI camera",
             "sudo apt install libcamera-ipa"}};
  }
  const std::string needed = "ipa_rpi_pisp.so";
  if (is_raspberry_pi_5(machine) &&
      std::find(modules.begin(), modules.end(), needed) == modules.end()) {
    return {{bad,
             fmt::format("{} is not among libcamera's modules: this version knows no CSI camera of "
                         "this board",
                         needed),
             "build the packages where libcamera has it, as on Raspberry Pi OS"}};
  }
  return {{Verdict::good, fmt::format("libcamera has {}", fmt::join(modules, ", ")), ""}};
}

Findings check_spi(const Machine& machine, const hal::RingConfig& ring) {
  const hal::Ws2812Config& config = ring.ws2812;
  if (ring.backend != "ws2812_spi") {
    return {{Verdict::good, fmt::format("ring.backend = \"{}\" needs no SPI", ring.backend), ""}};
  }
  Findings findings;
  const hal::ws2812::SpiFormat format{config.spi_bits, static_cast<double>(config.spi_hz)};
  const std::string refused = hal::ws2812::why_refused(format);
  if (refused.empty()) {
    findings.push_back({Verdict::good,
                        fmt::format("{:.3f} MHz with {} SPI bits for each WS2812B bit fits",
                                    format.hz / 1e6, format.bits),
                        ""});
  } else {
    findings.push_back({Verdict::wrong, refused, "set ring.ws2812.spi_hz and spi_bits"});
  }

  const int error = machine.access(config.spi_device);
  if (error == ENOENT) {
    findings.push_back(
        {Verdict::wrong, fmt::format("{} is not there", config.spi_device),
         is_raspberry_pi(machine)
             ? "sudo raspi-config nonint do_spi 0 && sudo reboot"
             : "enable the SPI controller and a spidev child in the board's device tree; ls "
               "/dev/spidev*"});
    return findings;
  }
  if (error != 0) {
    findings.push_back({Verdict::wrong,
                        fmt::format("{}: {}", config.spi_device, std::strerror(error)),
                        join_group(machine, config.spi_device, "spi")});
    return findings;
  }
  findings.push_back({Verdict::good, fmt::format("{} may be opened", config.spi_device), ""});

  const std::array<hal::Rgb, hal::kLedCount> leds{};
  const std::size_t need = refused.empty() ? hal::ws2812::encode(leds, format).size() : 0;
  const std::string bufsiz = machine.line("/sys/module/spidev/parameters/bufsiz").value_or("4096");
  if (std::strtoull(bufsiz.c_str(), nullptr, 10) < need) {
    findings.push_back(
        {Verdict::wrong, fmt::format("spidev.bufsiz = {}, the ring needs {}", bufsiz, need),
         fmt::format("put spidev.bufsiz=4096 on the kernel's command line{}, reboot",
                     is_raspberry_pi(machine) ? " (/boot/firmware/cmdline.txt)" : "")});
  } else {
    findings.push_back(
        {Verdict::good, fmt::format("spidev.bufsiz = {}, the ring needs {}", bufsiz, need), ""});
  }

  const Machine::SpiRate rate =
      machine.spi_rate(config.spi_device, static_cast<std::uint32_t>(config.spi_hz));
  if (!rate.error.empty()) {
    findings.push_back({Verdict::wrong, "the rate cannot be measured: " + rate.error, "dmesg"});
  } else if (const std::string off = hal::ws2812::why_rate_refused(format, rate.hz); !off.empty()) {
    findings.push_back(
        {Verdict::wrong, off,
         is_raspberry_pi(machine) ? "see core clock, below" : "choose another ring.ws2812.spi_hz"});
  } else {
    findings.push_back({Verdict::good, fmt::format("measured rate {:.3f} MHz", rate.hz / 1e6), ""});
  }
  return findings;
}

Findings check_pio(const Machine& machine, const hal::RingConfig& ring) {
  if (ring.backend != "ws2812_pio") return {};
  const std::string& device = ring.ws2812.pio_device;
  const int error = machine.access(device);
  if (error == 0) return {{Verdict::good, device + " may be opened", ""}};
  if (error != ENOENT) {
    return {{Verdict::wrong, fmt::format("{}: {}", device, std::strerror(error)),
             join_group(machine, device, "gpio")}};
  }
  // It is the RP1's PIO.
  return {{Verdict::wrong, device + " is not there",
           is_raspberry_pi_5(machine)
               ? "echo dtoverlay=ws2812-pio,gpio=18,num_leds=8 | sudo tee -a "
                 "/boot/firmware/config.txt && sudo reboot (any GPIO of the header)"
               : "set ring.backend = \"ws2812_spi\": only a Raspberry Pi 5 has this PIO"}};
}

Findings check_gpio(const Machine& machine, const hal::RingConfig& ring) {
  if (!ring.backend.starts_with("ws2812_") || !ring.ws2812.power.is_set()) {
    return {{Verdict::good, "no line is configured", ""}};
  }
  Findings findings;
  for (const std::string& node : machine.list("/dev", "gpiochip")) {
    if (const int error = machine.access(node); error != 0) {
      findings.push_back({Verdict::wrong, fmt::format("{}: {}", node, std::strerror(error)),
                          join_group(machine, node, "gpio")});
    }
  }
  findings.push_back(check_line(machine, "ring.ws2812.power", ring.ws2812.power));
  return findings;
}

}  // namespace dtact::app
