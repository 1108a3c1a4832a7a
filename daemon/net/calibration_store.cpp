#include "daemon/net/calibration_store.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <ranges>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include "hal/base/atomic_file.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::net {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLink = "calibration";
constexpr const char* kFolders = "calibrations";
// What is being written or removed; left over only by a power cut.
constexpr const char* kFresh = ".new";
constexpr const char* kStale = ".old";
constexpr const char* kToml = "calibration.toml";
constexpr const char* kPng = "reference.png";
constexpr const char* kAccepted = "accepted.toml";
constexpr const char* kStarts = "calibration.starts";
constexpr const char* kRecent = "recent";
// No calibration's name has a dot.
constexpr const char* kPinned = ".pinned";

/// "17" → 17. Nothing for whatever else lies in the folder.
std::optional<std::uint64_t> number_of(const fs::path& folder) {
  const std::string name = folder.filename().string();
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  const bool whole = error == std::errc{} && end == name.data() + name.size();
  if (!whole || number == 0 || std::to_string(number) != name) return std::nullopt;
  return number;
}

/// Rising.
std::vector<std::uint64_t> numbers_in(const fs::path& folders) {
  std::vector<std::uint64_t> numbers;
  if (!fs::exists(folders)) return numbers;
  for (const auto& entry : fs::directory_iterator(folders)) {
    if (const auto number = number_of(entry.path())) numbers.push_back(*number);
  }
  std::ranges::sort(numbers);
  return numbers;
}

/// Points STATE/calibration to `target` (relative to STATE) in one step.
void move_link(const fs::path& state, const fs::path& target) {
  const fs::path fresh = state / (std::string(kLink) + kFresh);
  fs::remove(fresh);
  fs::create_directory_symlink(target, fresh);
  fs::rename(fresh, state / kLink);
  fs::remove(state / kStarts);  // they were of the one before
  base::sync_folder(state);
}

/// When a calibration's folder got its content: it is never written again, only renamed.
std::string time_of(const fs::path& folder) {
  struct stat about{};
  if (::stat(folder.c_str(), &about) != 0) {
    throw std::system_error(errno, std::generic_category(), "cannot read " + folder.string());
  }
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(about.st_mtim.tv_sec));
}

/// A small file; empty where there is none that can be read.
std::string text_of(const fs::path& file) {
  try {
    return base::read_file(file, 65536);
  } catch (const std::system_error&) {
    return {};
  }
}

/// The folder's name, also for "cal/".
std::string name_of(const fs::path& folder) {
  return fs::weakly_canonical(folder).filename().string();
}

}  // namespace

FolderCalibrationStore::FolderCalibrationStore(fs::path state, fs::path configured)
    : state_(std::move(state)), configured_(std::move(configured)) {}

fs::path FolderCalibrationStore::current() const {
  std::error_code error;
  const fs::path target = fs::read_symlink(state_ / kLink, error);
  return error || target.empty() ? configured_ : state_ / target;
}

fs::path FolderCalibrationStore::folder_of(std::uint64_t number) const {
  if (number == kConfiguredCalibration) {
    if (!configured_.empty()) return configured_;
    throw NoSuchCalibration(
        "the configuration file names no calibration: set its key \"calibration\" and restart "
        "dtactd, or take one that dtactctl calibration list shows");
  }
  const fs::path numbered = state_ / kFolders / std::to_string(number);
  if (!fs::is_directory(numbered)) {
    throw NoSuchCalibration(fmt::format(
        "there is no calibration {}: dtactctl calibration list shows those there are", number));
  }
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(numbered)) {
    if (entry.is_directory()) folders.push_back(entry.path());
  }
  if (folders.size() == 1) return folders.front();
  throw std::runtime_error(fmt::format(
      "{}: holds {} folders where one is expected: remove {} and upload the calibration again",
      numbered.string(), folders.size(), numbered.string()));
}

std::optional<std::uint64_t> FolderCalibrationStore::current_number() const {
  std::error_code error;
  const fs::path target = fs::read_symlink(state_ / kLink, error);
  if (error || target.empty()) {
    return configured_.empty() ? std::nullopt : std::optional(kConfiguredCalibration);
  }
  const fs::path numbered = target.parent_path();
  return numbered.parent_path() == kFolders ? number_of(numbered) : std::nullopt;
}

std::optional<std::uint64_t> FolderCalibrationStore::started_number() const {
  if (!passed_over_) return current_number();
  return configured_.empty() ? std::nullopt : std::optional(kConfiguredCalibration);
}

bool FolderCalibrationStore::begin_start() {
  std::error_code error;
  const std::string target = fs::read_symlink(state_ / kLink, error).string();
  if (error || target.empty()) return true;
  int begun = 0;  // before this one, with the same calibration
  std::istringstream file(text_of(state_ / kStarts));
  std::string of;
  if (!(std::getline(file, of) && of == target && file >> begun)) begun = 0;
  passed_over_ = begun >= kMaxFailedStarts;
  if (passed_over_) return false;
  try {
    base::write_file_atomically(state_ / kStarts, fmt::format("{}\n{}\n", target, begun + 1));
  } catch (const std::system_error&) {  // NOLINT(bugprone-empty-catch)
    // A full disk is no reason not to start: then this one is not counted.
  }
  return true;
}

void FolderCalibrationStore::end_start() {
  std::error_code ignored;  // one too many was counted then
  if (passed_over_ || !fs::remove(state_ / kStarts, ignored)) return;
  try {
    // Else power cuts soon after good starts would count as starts that ended early.
    base::sync_folder(state_);
  } catch (const std::system_error&) {  // NOLINT(bugprone-empty-catch)
    // A disk that cannot be written keeps no count, either.
  }
}

FolderCalibrationStore::Digests FolderCalibrationStore::digests_of(const CalibrationFiles& files) {
  return {calibration::sha256_hex(files.toml), calibration::sha256_hex(files.png)};
}

std::shared_ptr<const calibration::Calibration> FolderCalibrationStore::check(
    const CalibrationFiles& files, const std::optional<calibration::FrameSize>& camera) {
  auto parsed = calibration::parse(files.toml, files.png, "upload " + files.name, camera);
  parsed.name = files.name;
  accepted_ = {digests_of(files), summarise(parsed)};
  return std::make_shared<const calibration::Calibration>(std::move(parsed));
}

void FolderCalibrationStore::write_folder(const fs::path& folders, std::uint64_t number,
                                          const CalibrationFiles& files) const {
  const fs::path fresh = folders / kFresh;
  fs::remove_all(fresh);
  try {
    fs::create_directories(fresh / files.name);
    base::write_file_atomically(fresh / files.name / kToml, files.toml);
    base::write_file_atomically(fresh / files.name / kPng, files.png);
    if (accepted_.digests == digests_of(files)) {
      base::write_file_atomically(
          fresh / kAccepted,
          fmt::format("# What dtactd found in the calibration of these digests.\n"
                      "toml_sha256 = \"{}\"\npng_sha256 = \"{}\"\n{}",
                      accepted_.digests.toml, accepted_.digests.png, format(accepted_.summary)));
    }
    base::sync_folder(fresh);
    fs::rename(fresh, folders / std::to_string(number));
  } catch (...) {
    std::error_code ignored;
    fs::remove_all(fresh, ignored);
    throw;
  }
  base::sync_folder(folders);
}

KeptCalibration FolderCalibrationStore::keep(const CalibrationFiles& files) {
  const fs::path folders = state_ / kFolders;
  fs::create_directories(folders);
  const auto numbers = numbers_in(folders);
  // The newest is never removed, so that no number comes again.
  const std::uint64_t number = numbers.empty() ? 1 : numbers.back() + 1;
  write_folder(folders, number, files);
  note_use(number);
  move_link(state_, fs::path(kFolders) / std::to_string(number) / files.name);
  return {number, remove_old()};
}

std::vector<std::uint64_t> FolderCalibrationStore::by_use() const {
  const std::vector<std::uint64_t> uploaded = numbers_in(state_ / kFolders);
  std::vector<std::uint64_t> numbers;
  const auto add = [&](std::uint64_t number) {
    if (std::ranges::find(numbers, number) == numbers.end()) numbers.push_back(number);
  };
  std::istringstream noted(text_of(state_ / kFolders / kRecent));
  for (std::uint64_t number = 0; noted >> number;) {
    if (std::ranges::binary_search(uploaded, number)) add(number);
  }
  for (const std::uint64_t number : std::views::reverse(uploaded)) add(number);
  return numbers;
}

void FolderCalibrationStore::note_use(std::uint64_t number) const {
  std::vector<std::uint64_t> numbers = by_use();
  std::erase(numbers, number);
  numbers.insert(numbers.begin(), number);
  for (const auto& entry : fs::directory_iterator(state_ / kFolders)) {
    // Left over by a power cut.
    if (entry.path().stem() == kRecent && entry.path().has_extension()) fs::remove(entry.path());
  }
  base::write_file_atomically(state_ / kFolders / kRecent,
                              fmt::format("{}\n", fmt::join(numbers, "\n")));
}

std::vector<StoredCalibration> FolderCalibrationStore::remove_old() const {
  const fs::path folders = state_ / kFolders;
  const fs::path stale = folders / kStale;
  std::error_code ignored;  // What cannot be removed only takes room.
  std::vector<StoredCalibration> removed;
  std::size_t kept = 0;
  for (const std::uint64_t number : by_use()) {
    const fs::path folder = folders / std::to_string(number);
    if (fs::exists(folder / kPinned, ignored) || kept++ < kKept || number == current_number()) {
      continue;
    }
    StoredCalibration old;
    old.number = number;
    try {
      old.name = name_of(folder_of(number));
      old.uploaded = time_of(folder_of(number));
    } catch (const std::exception&) {
      old.name = "(damaged)";
    }
    // Out of the list in one step: half a folder would be listed as a damaged calibration.
    fs::remove_all(stale, ignored);
    fs::rename(folder, stale, ignored);
    if (!ignored) removed.push_back(std::move(old));
    fs::remove_all(stale, ignored);
  }
  std::ranges::sort(removed, {}, &StoredCalibration::number);
  return removed;
}

void FolderCalibrationStore::pin(std::uint64_t number, bool pinned) {
  if (number == kConfiguredCalibration) {
    throw std::invalid_argument(
        "the calibration that the configuration names is never removed: there is nothing to pin");
  }
  const fs::path folder = folder_of(number).parent_path();
  if (!pinned) {
    fs::remove(folder / kPinned);
    return base::sync_folder(folder);
  }
  std::size_t count = 0;
  for (const std::uint64_t other : numbers_in(state_ / kFolders)) {
    if (other != number && fs::exists(state_ / kFolders / std::to_string(other) / kPinned)) ++count;
  }
  if (count >= kMaxPinned) {
    throw std::invalid_argument(
        fmt::format("{} calibrations are pinned and no more are allowed: unpin one", count));
  }
  base::write_file_atomically(folder / kPinned, "");
}

std::vector<StoredCalibration> FolderCalibrationStore::list() {
  std::vector<StoredCalibration> all;
  const auto current = current_number();
  const auto add = [&](std::uint64_t number) {
    StoredCalibration& stored = all.emplace_back();
    stored.number = number;
    stored.current = number == current;
    try {
      const fs::path folder = folder_of(number);
      stored.name = name_of(folder);
      if (number != kConfiguredCalibration) {
        stored.uploaded = time_of(folder);
        stored.pinned = fs::exists(folder.parent_path() / kPinned);
      }
      stored.summary = summary_of(number, folder);
    } catch (const std::exception& e) {
      stored.damage = e.what();
    }
  };
  if (!configured_.empty()) add(kConfiguredCalibration);
  for (const std::uint64_t number : numbers_in(state_ / kFolders)) add(number);
  // Those that were removed.
  std::erase_if(known_, [&](const auto& known) {
    return std::ranges::find(all, known.first, &StoredCalibration::number) == all.end();
  });
  return all;
}

FolderCalibrationStore::Stamp FolderCalibrationStore::stamp_of(const fs::path& file) {
  struct stat about{};
  if (::stat(file.c_str(), &about) != 0) return {};  // a reader of the file reports the error
  const auto ns_of = [](const timespec& time) {
    return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
  };
  return {.inode = about.st_ino,
          .size = about.st_size,
          .modified_ns = ns_of(about.st_mtim),
          .changed_ns = ns_of(about.st_ctim)};
}

std::optional<CalibrationSummary> FolderCalibrationStore::accepted_summary(const fs::path& folder) {
  const fs::path record = folder.parent_path() / kAccepted;
  if (!fs::exists(record)) return std::nullopt;
  try {
    const toml::table document = tomlfile::parse(base::read_file(record), record.string());
    tomlfile::KeyReader reader(document, record.string());
    const Digests digests{reader.text("toml_sha256"), reader.text("png_sha256")};
    CalibrationSummary summary = read_summary(reader, name_of(folder));
    reader.finish();
    const CalibrationFiles files{
        .name = {}, .toml = base::read_file(folder / kToml), .png = base::read_file(folder / kPng)};
    if (digests == digests_of(files)) return summary;
  } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch)
    // Then the calibration itself is read, and says what is wrong.
  }
  return std::nullopt;
}

CalibrationSummary FolderCalibrationStore::summary_of(std::uint64_t number,
                                                      const fs::path& folder) {
  // Taken before the files are read: one that changes meanwhile is read again the next time.
  const Stamps now{stamp_of(folder / kToml), stamp_of(folder / kPng)};
  const auto found = known_.find(number);
  if (found != known_.end() && found->second.folder == folder && found->second.stamps == now) {
    return found->second.summary;
  }
  known_.erase(number);
  auto accepted = number == kConfiguredCalibration ? std::nullopt : accepted_summary(folder);
  const CalibrationSummary summary =
      accepted ? std::move(*accepted) : summarise(calibration::load(folder));
  known_.emplace(number, Known{folder, now, summary});
  return summary;
}

std::shared_ptr<const calibration::Calibration> FolderCalibrationStore::load(
    std::uint64_t number, const std::optional<calibration::FrameSize>& camera) {
  return std::make_shared<const calibration::Calibration>(
      calibration::load(folder_of(number), camera));
}

void FolderCalibrationStore::make_current(std::uint64_t number) {
  const fs::path folder = folder_of(number);
  if (number != kConfiguredCalibration) {
    note_use(number);
    return move_link(state_,
                     fs::path(kFolders) / folder.parent_path().filename() / folder.filename());
  }
  fs::remove(state_ / kLink);
  fs::remove(state_ / kStarts);
  base::sync_folder(state_);
}

CalibrationFiles FolderCalibrationStore::read(std::uint64_t number) {
  const fs::path folder = folder_of(number);
  return {name_of(folder), base::read_file(folder / kToml), base::read_file(folder / kPng), number};
}

}  // namespace dtact::net
