// A recording: timestamps.csv, then its frames, with a line "--" between each; or an MCAP file.
// An accepted recording plays to its end.
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <stdexcept>

#include "hal/files/mcap_format.hpp"
#include "hal/replay/replay_camera.hpp"
#include "tests/fakes/fake_clock.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/png_checksums.hpp"

namespace dtact::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxFrames = 4;

/// The folder for every input's files.
class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "dtact-fuzz.XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }

  /// Returns the value for camera.replay.folder.
  [[nodiscard]] fs::path lay_out(std::string_view input) const {
    for (const auto& entry : fs::directory_iterator(path_)) fs::remove(entry);
    if (input.starts_with(mcap::kMagic)) {
      write("a.mcap", input);
      return path_ / "a.mcap";
    }
    const auto parts = split(input, "\n--\n", 1 + kMaxFrames);
    if (!parts.front().empty()) write("timestamps.csv", parts.front());
    for (std::size_t i = 1; i < parts.size(); ++i) {
      if (parts[i].starts_with("\x89PNG")) {
        write(fmt::format("{}.png", i), with_right_checksums(parts[i]));
      } else {
        write(fmt::format("{}.jpg", i), parts[i]);
      }
    }
    return path_;
  }

 private:
  void write(const std::string& name, std::string_view content) const {
    std::ofstream(path_ / name, std::ios::binary) << content;
  }

  fs::path path_;
};

void play(const hal::CameraConfig& config) {
  fakes::FakeClock clock;
  hal::replay::ReplayCamera camera(config, clock);
  const hal::CameraInfo info = camera.info();
  require(info.width > 0 && info.height > 0 && info.fps > 0, "a recording has a size and a rate");
  // Larger ones add nothing and take long.
  if (info.width > 1024 || info.height > 1024) return;
  camera.start();
  std::size_t grabs = 0;
  for (hal::Frame frame;;) {
    const auto status = camera.grab(frame, std::chrono::hours(24 * 365));
    // A gap of more than a year is not waited for.
    if (status == hal::GrabStatus::ended || status == hal::GrabStatus::timeout) break;
    // A message of an MCAP file has 31 bytes at least.
    require(++grabs <= 65536 / 31, "a recording ends");
    if (status != hal::GrabStatus::ok) continue;
    require(frame.luma().width == info.width && frame.luma().height == info.height,
            "every frame has the camera's size");
    frame.reset();
  }
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  static const fuzz::Folder folder;
  hal::CameraConfig config;
  config.replay.folder = folder.lay_out({reinterpret_cast<const char*>(data), size});
  config.replay.loop = false;
  for (const bool paced : {false, true}) {
    config.replay.paced = paced;
    try {
      fuzz::play(config);
    } catch (const std::runtime_error& e) {
      fuzz::require(*e.what() != 0, "an error says something");
    }
  }
  return 0;
}
