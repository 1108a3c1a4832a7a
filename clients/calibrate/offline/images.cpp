#include "clients/calibrate/offline/images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <stdexcept>

#include "daemon/calibration/calibration.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/base/folder.hpp"
#include "hal/base/utf8.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> files_of(const fs::path& path, const std::string& option) {
  if (!fs::is_directory(path)) return {path};
  std::vector<fs::path> files;
  for (const fs::path& file : base::visible_files(path)) {
    if (file.extension() == ".png") files.push_back(file);
  }
  if (files.empty()) {
    throw std::runtime_error(
        fmt::format("{}: no .png file in the folder {}", option, path.string()));
  }
  return files;
}

/// A reference of a calibration or of a recording holds grey × 256, other images of 16 bits grey ×
/// 257.
bool is_reference(const fs::path& file, const std::string& bytes) {
  const std::string name = file.filename();
  return (name == "reference.png" || name == "current_reference.png") &&
         image::png_header(bytes, file.string()).bits == 16;
}

}  // namespace

std::pair<int, int> pair_of(const std::string& text, const char* option) {
  int first = 0;
  int second = 0;
  char rest = 0;
  // NOLINTNEXTLINE(cert-err34-c): the count says what was read, the range is checked below
  if (std::sscanf(text.c_str(), "%4dx%4d%c", &first, &second, &rest) != 2 || first < 2 ||
      second < 2 || first > 100 || second > 100) {
    throw std::runtime_error(fmt::format(
        "{}: \"{}\" is not allowed; expected two numbers from 2 to 100 as 7x9", option, text));
  }
  return {first, second};
}

std::vector<image::Grey8> ImageSet::frames() const {
  std::vector<image::Grey8> all;
  for (const image::Grey16& wide : images) {
    image::Grey8& frame = all.emplace_back(image::Grey8{wide.width, wide.height, {}});
    frame.pixels.resize(wide.pixels.size());
    std::ranges::transform(wide.pixels, frame.pixels.begin(), [](std::uint16_t value) {
      return static_cast<std::uint8_t>((value + 128) / 257);
    });
  }
  return all;
}

image::Grey16 ImageSet::mean_q8() const {
  image::Grey16 mean{width(), height(), {}};
  mean.pixels.resize(images.front().pixels.size());
  // 65535 is grey level 255, in Q8 65280: 256/257 of it.
  const auto divisor = 257.0 * static_cast<double>(images.size());
  for (std::size_t i = 0; i < mean.pixels.size(); ++i) {
    double sum = 0;
    for (const image::Grey16& wide : images) sum += wide.pixels[i];
    mean.pixels[i] = static_cast<std::uint16_t>(std::lround(sum * 256 / divisor));
  }
  return mean;
}

ImageSet load_images(const std::vector<std::string>& paths, const std::string& option) {
  ImageSet set;
  for (const std::string& path : paths) {
    for (const fs::path& file : files_of(path, option)) {
      const std::string bytes = base::read_file(file);
      image::Grey16 image = image::decode_png_grey16(bytes, file.string());
      if (is_reference(file, bytes)) {
        std::ranges::transform(image.pixels, image.pixels.begin(), [](std::uint16_t q8) {
          return static_cast<std::uint16_t>(std::min(65535, (q8 * 257 + 128) / 256));
        });
      }
      if (!set.images.empty() && (image.width != set.width() || image.height != set.height())) {
        throw std::runtime_error(fmt::format("{}: {} is {}x{} but {} is {}x{}", option,
                                             file.string(), image.width, image.height,
                                             set.sources.front().name, set.width(), set.height()));
      }
      set.images.push_back(std::move(image));
      set.sources.push_back(
          {base::as_utf8(file.filename().string()), calibration::sha256_hex(bytes)});
    }
  }
  return set;
}

void require_same_size(const ImageSet& a, const std::string& a_option, const ImageSet& b,
                       const std::string& b_option) {
  if (a.width() == b.width() && a.height() == b.height()) return;
  throw std::runtime_error(
      fmt::format("{} is {}x{} but {} is {}x{}; both must come from one camera mode", a_option,
                  a.width(), a.height(), b_option, b.width(), b.height()));
}

cv::Mat1f mean_levels(const ImageSet& set) {
  const image::Grey16 mean = set.mean_q8();
  cv::Mat1f levels(mean.height, mean.width);
  std::ranges::transform(mean.pixels, levels.begin(),
                         [](std::uint16_t q8) { return static_cast<float>(q8) / 256; });
  return levels;
}

std::vector<cv::Mat1b> grey_images(const ImageSet& set) {
  std::vector<cv::Mat1b> images;
  for (const image::Grey8& frame : set.frames()) {
    images.emplace_back(frame.height, frame.width);
    std::ranges::copy(frame.pixels, images.back().begin());
  }
  return images;
}

}  // namespace dtact::ctl
