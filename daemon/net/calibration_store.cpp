#include "daemon/net/calibration_store.hpp"

#include <algorithm>
#include <charconv>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include "hal/base/atomic_file.hpp"

namespace dtact::net {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLink = "calibration";
constexpr const char* kFolders = "calibrations";
constexpr const char* kToml = "calibration.toml";
constexpr const char* kPng = "reference.png";

/// "17" → 17. Nothing for whatever else lies in the folder.
std::optional<unsigned long> number_of(const fs::path& folder) {
  const std::string name = folder.filename().string();
  unsigned long number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error != std::errc{} || end != name.data() + name.size()) return std::nullopt;
  return number;
}

unsigned long newest_number(const fs::path& folders) {
  unsigned long newest = 0;
  for (const auto& entry : fs::directory_iterator(folders)) {
    newest = std::max(newest, number_of(entry.path()).value_or(0));
  }
  return newest;
}

/// All but `current` and `previous`, each STATE/calibrations/NUMBER/NAME.
void remove_others(const fs::path& folders, const fs::path& current, const fs::path& previous) {
  std::error_code ignored;  // What cannot be removed only takes room.
  for (const auto& entry : fs::directory_iterator(folders, ignored)) {
    if (!number_of(entry.path()).has_value()) continue;
    if (entry.path() == current.parent_path() || entry.path() == previous.parent_path()) continue;
    fs::remove_all(entry.path(), ignored);
  }
}

/// Points STATE/calibration to `target` (relative to STATE) in one step.
void move_link(const fs::path& state, const fs::path& target) {
  const fs::path fresh = state / (std::string(kLink) + ".new");
  fs::remove(fresh);
  fs::create_directory_symlink(target, fresh);
  fs::rename(fresh, state / kLink);
  base::sync_folder(state);
}

}  // namespace

FolderCalibrationStore::FolderCalibrationStore(fs::path state, fs::path in_use)
    : state_(std::move(state)), in_use_(std::move(in_use)) {}

fs::path FolderCalibrationStore::current(const fs::path& state) {
  std::error_code error;
  const fs::path target = fs::read_symlink(state / kLink, error);
  return error || target.empty() ? fs::path() : state / target;
}

std::shared_ptr<const calibration::Calibration> FolderCalibrationStore::check(
    const CalibrationFiles& files) {
  auto parsed = calibration::parse(files.toml, files.png, "upload " + files.name);
  parsed.name = files.name;
  return std::make_shared<const calibration::Calibration>(std::move(parsed));
}

void FolderCalibrationStore::keep(const CalibrationFiles& files) {
  const fs::path folders = state_ / kFolders;
  fs::create_directories(folders);
  const fs::path previous = current(state_);
  const fs::path target =
      fs::path(kFolders) / std::to_string(newest_number(folders) + 1) / files.name;
  const fs::path folder = state_ / target;
  fs::create_directories(folder);
  base::write_file_atomically(folder / kToml, files.toml);
  base::write_file_atomically(folder / kPng, files.png);
  base::sync_folder(folder.parent_path());
  base::sync_folder(folders);
  move_link(state_, target);
  in_use_ = folder;
  remove_others(folders, folder, previous);
}

CalibrationFiles FolderCalibrationStore::read() {
  if (in_use_.empty()) throw std::runtime_error("no calibration folder is in use");
  return {in_use_.filename().string(), base::read_file(in_use_ / kToml),
          base::read_file(in_use_ / kPng)};
}

}  // namespace dtact::net
