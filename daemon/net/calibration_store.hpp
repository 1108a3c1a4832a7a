#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "daemon/calibration/calibration.hpp"

namespace dtact::net {

/// A calibration as it travels: a name and its two files' contents.
struct CalibrationFiles {
  std::string name;
  std::string toml;  ///< calibration.toml
  std::string png;   ///< reference.png, 16-bit grey
};

/// Where uploaded calibrations are checked and kept. Only the network part's worker thread calls
/// it, one call at a time.
class CalibrationStore {
 public:
  CalibrationStore() = default;
  CalibrationStore(const CalibrationStore&) = delete;
  CalibrationStore& operator=(const CalibrationStore&) = delete;
  virtual ~CalibrationStore() = default;

  /// The files as a calibration. Changes nothing. Throws std::runtime_error naming file, line, key
  /// and remedy.
  [[nodiscard]] virtual std::shared_ptr<const calibration::Calibration> check(
      const CalibrationFiles& files) = 0;
  /// Makes checked files the ones that the daemon starts with from now on; the ones before stay
  /// beside them. Throws std::exception naming the path.
  virtual void keep(const CalibrationFiles& files) = 0;
  /// The files of the calibration in use. Throws std::exception naming the path.
  [[nodiscard]] virtual CalibrationFiles read() = 0;
};

/// Keeps them in the state directory:
///
///     STATE/calibrations/1/ball/calibration.toml, reference.png   the one before
///     STATE/calibrations/2/ball/…                                 the current one
///     STATE/calibration → calibrations/2/ball
///
/// A folder is written and synced as a whole before the link moves to it by a rename, so that at
/// any moment there is one whole calibration. Only the current one and the one before are kept.
class FolderCalibrationStore : public CalibrationStore {
 public:
  /// `state`: an existing folder. `in_use`: the folder that the daemon has loaded, for read();
  /// empty when none.
  FolderCalibrationStore(std::filesystem::path state, std::filesystem::path in_use);

  /// The folder uploaded last, or an empty path: what to load at start before the configured one.
  [[nodiscard]] static std::filesystem::path current(const std::filesystem::path& state);

  [[nodiscard]] std::shared_ptr<const calibration::Calibration> check(
      const CalibrationFiles& files) override;
  void keep(const CalibrationFiles& files) override;
  [[nodiscard]] CalibrationFiles read() override;

 private:
  std::filesystem::path state_;
  std::filesystem::path in_use_;
};

}  // namespace dtact::net
