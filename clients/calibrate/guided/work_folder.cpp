#include "clients/calibrate/guided/work_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "daemon/calibration/sensor_files.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::ctl::guided {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxFrames = 100;

std::string frame_name(std::size_t number) { return fmt::format("{:02}.png", number); }

void save(const fs::path& folder, const std::vector<image::Grey8>& frames,
          const base::FolderFiles& more) {
  base::FolderFiles files = more;
  for (const image::Grey8& frame : frames) {
    files.emplace_back(frame_name(files.size() - more.size()), image::encode_png(frame));
  }
  std::vector<std::string> known{calibration::kSensorName};
  for (std::size_t i = 0; i < kMaxFrames; ++i) known.push_back(frame_name(i));
  base::write_folder_atomically(folder, files, known, "a folder of taken images");
}

bool is_press(const std::string& name) {
  constexpr const char* kPrefix = "press-";
  return name.starts_with(kPrefix) && name.size() >= 8 && name.size() <= 12 &&
         name.find_first_not_of("0123456789", 6) == std::string::npos;
}

}  // namespace

WorkFolder::WorkFolder(fs::path path) : path_(std::move(path)) { fs::create_directories(path_); }

bool WorkFolder::has_reference() const {
  return fs::exists(path_ / kReference / calibration::kSensorName);
}

std::vector<std::string> WorkFolder::presses() const {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(path_)) {
    std::string name = entry.path().filename().string();
    if (entry.is_directory() && is_press(name)) names.push_back(std::move(name));
  }
  std::ranges::sort(names, {}, [](const std::string& name) { return std::stoi(name.substr(6)); });
  return names;
}

std::string WorkFolder::next_press() const {
  const std::vector<std::string> names = presses();
  return fmt::format("press-{:02}", names.empty() ? 1 : std::stoi(names.back().substr(6)) + 1);
}

void WorkFolder::save_reference(const std::vector<image::Grey8>& frames,
                                const calibration::Origin& origin) {
  save(path_ / kReference, frames,
       {{calibration::kSensorName, calibration::format_sensor(origin)}});
}

void WorkFolder::save_press(const std::string& name, const std::vector<image::Grey8>& frames) {
  save(path_ / name, frames, {});
}

void WorkFolder::require_ball(double radius_mm) const {
  constexpr const char* kRadius = "radius_mm";
  const fs::path file = path_ / "ball.toml";
  if (fs::exists(file) && !presses().empty()) {
    const toml::table document = tomlfile::parse(base::read_file(file), file.string());
    tomlfile::KeyReader reader(document, file.string());
    const double there = reader.number(kRadius, 0.1, 100);
    reader.finish();
    if (there == radius_mm) return;
    throw std::runtime_error(fmt::format(
        "the presses in {} are of a ball of {:g} mm radius, not {:g} mm: give --radius-mm {:g}, or "
        "begin again in another --folder",
        path_.string(), there, radius_mm, there));
  }
  base::write_file_atomically(file, fmt::format("{} = {}\n", kRadius, radius_mm));
}

void WorkFolder::save_preview(const image::Rgb8& picture) {
  base::write_file_atomically(path_ / "preview.png", image::encode_png(picture));
}

std::string WorkFolder::calibration_name() const {
  std::string name = fs::weakly_canonical(path_).filename().string();
  std::ranges::replace_if(
      name,
      [](char c) {
        return !((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                 c == '-' || c == '_');
      },
      '-');
  return name.empty() ? "calibration" : name.substr(0, 64);
}

}  // namespace dtact::ctl::guided
