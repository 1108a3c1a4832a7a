#include <filesystem>
#include <stdexcept>

#include "daemon/calibration/calibration.hpp"
#include "daemon/calibration/text.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::calibration {

namespace fs = std::filesystem;

Calibration load(const fs::path& folder) {
  if (!fs::is_directory(folder)) {
    throw std::runtime_error(folder.string() +
                             ": no such folder; make a calibration with dtactctl calibrate depth");
  }
  const fs::path toml = folder / kTomlName;
  const std::string text = base::read_file(toml);
  const std::string reference = base::read_file(folder / kReferenceName);
  Calibration calibration = parse(text, reference, toml.string());
  calibration.name = fs::weakly_canonical(folder).filename().string();
  return calibration;
}

void save(const Calibration& calibration, const fs::path& folder) {
  const Files files = format(calibration);
  base::write_folder_atomically(folder,
                                {{kReferenceName, files.reference_png}, {kTomlName, files.toml}},
                                {kTomlName, kReferenceName}, "a calibration");
}

}  // namespace dtact::calibration
