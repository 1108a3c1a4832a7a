#include "daemon/calibration/calibration.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "daemon/calibration/text.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::calibration {

namespace fs = std::filesystem;

Calibration load(const fs::path& folder, const std::optional<FrameSize>& camera) {
  if (!fs::is_directory(folder)) {
    throw std::runtime_error(folder.string() +
                             ": no such folder; make a calibration with dtact-calibrate depth");
  }
  const fs::path toml = folder / kTomlName;
  const std::string text = base::read_file(toml);
  const std::string reference = base::read_file(folder / kReferenceName);
  Calibration calibration = parse(text, reference, toml.string(), camera);
  calibration.name = fs::weakly_canonical(folder).filename().string();
  return calibration;
}

void save(const Calibration& calibration, const fs::path& folder) {
  const Files files = format(calibration);
  // What the daemon would refuse must not replace a calibration that it takes.
  (void)parse(files.toml, files.reference_png, folder.string());
  base::write_folder_atomically(folder,
                                {{kReferenceName, files.reference_png}, {kTomlName, files.toml}},
                                {kTomlName, kReferenceName}, "a calibration");
}

recon::RectifyTable map_table(const std::optional<recon::Lens>& lens, int frame_width,
                              int frame_height, const recon::MapPlace& place,
                              std::vector<std::uint8_t>& outside) {
  if (lens) return recon::make_lens_table(*lens, frame_width, frame_height, place, outside);
  outside.clear();
  return recon::make_crop_table(frame_width, frame_height, place.col, place.row, place.width,
                                place.height);
}

std::string FrameSize::text() const {
  std::string size = fmt::format("{}x{}", width, height);
  if (decode_scale == 1) return size;
  return size + fmt::format(" (decoded from {}x{})", width * decode_scale, height * decode_scale);
}

std::shared_ptr<const Calibration> for_scaled_frames(std::shared_ptr<const Calibration> calibration,
                                                     int scale) {
  if (scale == 1) return calibration;
  Calibration scaled = *calibration;
  scaled.model =
      std::make_shared<const recon::Model>(recon::for_scaled_frames(*calibration->model, scale));
  return std::make_shared<const Calibration>(std::move(scaled));
}

void add_untrusted(recon::Model& model, const std::vector<std::uint8_t>& outside) {
  if (std::ranges::none_of(outside, [](std::uint8_t mark) { return mark != 0; })) return;
  model.untrusted.resize(outside.size());
  std::ranges::transform(model.untrusted, outside, model.untrusted.begin(),
                         [](std::uint8_t a, std::uint8_t b) { return a != 0 || b != 0; });
}

std::string sha256_hex(std::string_view bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1) {
    throw std::runtime_error("SHA-256 is not available in this system's libcrypto");
  }
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string hex;
  for (unsigned int i = 0; i < size; ++i) {
    hex += kDigits[digest[i] >> 4U];
    hex += kDigits[digest[i] & 15U];
  }
  return hex;
}

}  // namespace dtact::calibration
