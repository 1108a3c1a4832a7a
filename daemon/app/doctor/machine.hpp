#pragma once

#include <sys/resource.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hal/gpiod/lines.hpp"
#include "hal/v4l2/survey.hpp"

namespace dtact::app {

/// Whom dtactd.service runs as.
inline constexpr const char* kServiceUser = "dtactd";

/// 0 when a user may read and write a file, by its mode and the user's groups, else an errno.
[[nodiscard]] int access_as(const std::string& user, const std::filesystem::path& file);

/// What the doctor asks of a machine. Files are looked up below `root`, so that a test brings a
/// tree of its own; what files cannot answer is virtual.
class Machine {
 public:
  explicit Machine(std::filesystem::path root = "/") : root_(std::move(root)) {}
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;
  virtual ~Machine() = default;

  /// First line of a file without its end; nothing when it cannot be read.
  [[nodiscard]] std::optional<std::string> line(const std::string& path) const;
  /// The whole file; empty when it cannot be read.
  [[nodiscard]] std::string text(const std::string& path) const;
  /// Paths in a folder whose names begin so, sorted.
  [[nodiscard]] std::vector<std::string> list(const std::string& folder,
                                              const std::string& prefix) const;

  /// The board's name of itself, as "Raspberry Pi 5 Model B Rev 1.0"; empty without a device tree.
  [[nodiscard]] std::string model() const { return line("/proc/device-tree/model").value_or(""); }

  /// Whether the file exists.
  [[nodiscard]] bool has(const std::string& path) const;
  /// Whether dtactd.service is installed.
  [[nodiscard]] bool has_service() const;

  /// 0 when user() may read and write it, else an errno.
  [[nodiscard]] virtual int access(const std::string& path) const;
  /// The group that owns a file; empty when unknown.
  [[nodiscard]] virtual std::string group(const std::string& path) const;
  /// Who is to open the devices: this user. For root, who may open any, the service's, if there is
  /// one.
  [[nodiscard]] virtual std::string user() const;
  /// Root, to whom limits do not apply.
  [[nodiscard]] virtual bool privileged() const;
  [[nodiscard]] virtual rlim_t limit(int resource) const;

  struct Video {
    bool captures = false;  ///< Frames come from it (a camera's second node gives metadata).
    std::string card;
    int error = 0;    ///< errno when it is no video node.
    bool usb = true;  ///< Nodes of image processors and codecs capture as well, on no USB port.
  };
  [[nodiscard]] virtual Video video(const std::string& path) const;

  struct SpiRate {
    double hz = 0;
    std::string error;  ///< Why there is none.
  };
  [[nodiscard]] virtual SpiRate spi_rate(const std::string& device, std::uint32_t asked_hz) const;

  [[nodiscard]] virtual std::vector<hal::gpiod::Chip> gpio_chips() const;
  [[nodiscard]] virtual std::string gpio_holder(const std::string& chip, int line) const;

  /// What a Raspberry Pi's firmware answers to `vcgencmd QUESTION`, as "throttled=0x0"; empty where
  /// it cannot be asked.
  [[nodiscard]] virtual std::string firmware(const std::string& question) const;
  [[nodiscard]] virtual std::vector<hal::v4l2::SurveyedCamera> cameras() const;

 protected:
  [[nodiscard]] std::filesystem::path below_root(const std::string& path) const;

 private:
  std::filesystem::path root_;
};

}  // namespace dtact::app
