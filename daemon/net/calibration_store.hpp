#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "daemon/net/calibration_summary.hpp"

namespace dtact::net {

/// The number of the calibration that the configuration file names. Uploaded ones count from 1.
inline constexpr std::uint64_t kConfiguredCalibration = 0;

/// A calibration as it travels: a name and its two files' contents.
struct CalibrationFiles {
  std::string name;
  std::string toml;                               ///< calibration.toml
  std::string png;                                ///< reference.png, 16-bit grey
  std::uint64_t number = kConfiguredCalibration;  ///< Ignored in an upload.
};

/// One of those that a store has.
struct StoredCalibration {
  std::uint64_t number = kConfiguredCalibration;
  std::string name = {};                           ///< The folder's name.
  std::string uploaded = {};                       ///< ISO 8601, UTC; empty for the configured one.
  bool current = false;                            ///< The daemon starts with it.
  std::optional<CalibrationSummary> summary = {};  ///< None when it cannot be read, …
  std::string damage = {};                         ///< … and why not: file, line, key and fix.
  bool pinned = false;                             ///< Never removed.
};

/// The result of keep().
struct KeptCalibration {
  std::uint64_t number = 0;
  std::vector<StoredCalibration> removed = {};  ///< Number, name and time of upload alone.
};

/// No calibration has the requested number.
class NoSuchCalibration : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// Where calibrations are checked and kept. Only the network part calls it, one call at a time, and
/// on its worker thread once that runs. Everything throws std::exception naming the path; what
/// takes a number throws NoSuchCalibration, too. std::invalid_argument: nothing has changed.
class CalibrationStore {
 public:
  CalibrationStore() = default;
  CalibrationStore(const CalibrationStore&) = delete;
  CalibrationStore& operator=(const CalibrationStore&) = delete;
  virtual ~CalibrationStore() = default;

  /// The files as a calibration. Changes nothing of what is kept. Refuses one for other frames than
  /// `camera`'s before anything of their size is made. Throws std::runtime_error naming file, line,
  /// key and fix.
  [[nodiscard]] virtual std::shared_ptr<const calibration::Calibration> check(
      const CalibrationFiles& files, const std::optional<calibration::FrameSize>& camera) = 0;
  /// Stores checked files under a new number and makes them current. Removes the calibrations
  /// beyond those that stay.
  virtual KeptCalibration keep(const CalibrationFiles& files) = 0;
  /// All there are: the configured one, then by number. Each is read and checked before it is
  /// listed for the first time, unless its files are those that check() accepted, and again when
  /// they have changed.
  [[nodiscard]] virtual std::vector<StoredCalibration> list() = 0;
  /// One, read and checked. Throws as check() does.
  [[nodiscard]] virtual std::shared_ptr<const calibration::Calibration> load(
      std::uint64_t number, const std::optional<calibration::FrameSize>& camera) = 0;
  /// Makes one current.
  virtual void make_current(std::uint64_t number) = 0;
  /// A pinned one is never removed. Throws std::invalid_argument for the configured one, and when
  /// too many are pinned.
  virtual void pin(std::uint64_t number, bool pinned) = 0;
  /// Nothing when there is none, or when the current one has no number. Throws nothing.
  [[nodiscard]] virtual std::optional<std::uint64_t> current_number() const = 0;
  /// The one that the daemon started with: the current one, unless that had to be passed over.
  [[nodiscard]] virtual std::optional<std::uint64_t> started_number() const {
    return current_number();
  }
  /// The files of one, unchecked. Throws NoSuchCalibration, or std::exception when they cannot be
  /// read.
  [[nodiscard]] virtual CalibrationFiles read(std::uint64_t number) = 0;
};

/// Keeps calibrations in the state directory:
///
///     STATE/calibrations/1/ball/calibration.toml, reference.png
///     STATE/calibrations/1/accepted.toml                          their digests and summary
///     STATE/calibrations/2/ball/…                                 the current one
///     STATE/calibration → calibrations/2/ball
///     STATE/calibration.starts                                    while a start is under way
///     STATE/calibrations/recent                                   the numbers by last use
///     STATE/calibrations/1/.pinned                                an empty file
///
/// Without the link the configured folder is current. A number's folder is written and synced as a
/// whole beside the others and renamed into place; then the link moves by a rename. So at
/// any moment, also after a power cut, there is one whole current calibration.
class FolderCalibrationStore : public CalibrationStore {
 public:
  /// Uploaded calibrations that stay besides pinned ones: those that were in use last, the current
  /// one among them. About 0.5 MB each at 800×600.
  static constexpr std::size_t kKept = 10;
  static constexpr std::size_t kMaxPinned = 20;

  /// Starts in a row that may end while they read the current uploaded calibration.
  static constexpr int kMaxFailedStarts = 3;

  /// `state`: an existing folder. `configured`: a calibration folder, or empty for none.
  FolderCalibrationStore(std::filesystem::path state, std::filesystem::path configured);

  /// The folder to start with: where the link points, whether or not that can be read, or else the
  /// configured one. Empty when there is none.
  [[nodiscard]] std::filesystem::path current() const;

  /// Counts a start that is about to read the current uploaded calibration. False after
  /// kMaxFailedStarts starts that did not reach end_start(): this one runs without it, and
  /// started_number() is the configured one's, until another one, or the same again, becomes
  /// current.
  [[nodiscard]] bool begin_start();
  /// The start has outlived its calibration.
  void end_start();

  [[nodiscard]] std::shared_ptr<const calibration::Calibration> check(
      const CalibrationFiles& files, const std::optional<calibration::FrameSize>& camera) override;
  KeptCalibration keep(const CalibrationFiles& files) override;
  [[nodiscard]] std::vector<StoredCalibration> list() override;
  [[nodiscard]] std::shared_ptr<const calibration::Calibration> load(
      std::uint64_t number, const std::optional<calibration::FrameSize>& camera) override;
  void make_current(std::uint64_t number) override;
  void pin(std::uint64_t number, bool pinned) override;
  /// Nothing also when the link leads elsewhere.
  [[nodiscard]] std::optional<std::uint64_t> current_number() const override;
  [[nodiscard]] std::optional<std::uint64_t> started_number() const override;
  [[nodiscard]] CalibrationFiles read(std::uint64_t number) override;

 private:
  /// Identifies a change of a file without reading it. Nanoseconds of the system clock.
  struct Stamp {
    std::uint64_t inode = 0;
    std::int64_t size = 0;
    std::int64_t modified_ns = 0;
    std::int64_t changed_ns = 0;  ///< Cannot be set back by a program.
    bool operator==(const Stamp&) const = default;
  };
  using Stamps = std::array<Stamp, 2>;  ///< for the two files of a calibration
  /// SHA-256 of the two files of a calibration.
  struct Digests {
    std::string toml;
    std::string png;
    bool operator==(const Digests&) const = default;
  };
  /// What check() accepted last.
  struct Accepted {
    Digests digests;
    CalibrationSummary summary;
  };
  /// A calibration that list() has read without error.
  struct Known {
    std::filesystem::path folder;
    Stamps stamps{};
    CalibrationSummary summary;
  };

  [[nodiscard]] static Digests digests_of(const CalibrationFiles& files);
  /// The summary beside the folder, if check() accepted just these files.
  [[nodiscard]] static std::optional<CalibrationSummary> accepted_summary(
      const std::filesystem::path& folder);
  /// Writes FOLDERS/NUMBER so that a power cut leaves either all of it or nothing with a number.
  void write_folder(const std::filesystem::path& folders, std::uint64_t number,
                    const CalibrationFiles& files) const;
  [[nodiscard]] static Stamp stamp_of(const std::filesystem::path& file);
  /// STATE/calibrations/NUMBER/NAME of an uploaded one, or the configured folder.
  [[nodiscard]] std::filesystem::path folder_of(std::uint64_t number) const;
  /// Uploaded ones in the order of their use, the last first; what was never noted, by upload.
  [[nodiscard]] std::vector<std::uint64_t> by_use() const;
  /// Notes that it comes into use.
  void note_use(std::uint64_t number) const;
  /// Removes what is neither among the last kKept in use, nor pinned, nor current.
  [[nodiscard]] std::vector<StoredCalibration> remove_old() const;
  /// The same as from load(), which takes tens of milliseconds; cached while nothing changes.
  [[nodiscard]] CalibrationSummary summary_of(std::uint64_t number,
                                              const std::filesystem::path& folder);

  std::filesystem::path state_;
  std::filesystem::path configured_;
  std::map<std::uint64_t, Known> known_;
  Accepted accepted_;
  bool passed_over_ = false;  ///< The current one, by this start.
};

}  // namespace dtact::net
