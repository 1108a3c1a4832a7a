#include "clients/perceive/recognition/taught_objects.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "hal/base/atomic_file.hpp"
#include "hal/base/utf8.hpp"
#include "hal/files/png.hpp"

namespace dtact::perceive {
namespace {

constexpr int kZero = 32768;  // the grey of depth 0
constexpr std::size_t kMaxPresses = 100;

std::vector<TouchMap> decode_presses(const std::string& bytes, const std::string& file) {
  constexpr int kSide = TouchMap::kSide;
  const image::PngHeader header = image::png_header(bytes, file);
  const auto count = static_cast<std::size_t>(header.height / kSide);
  if (header.width != kSide || header.height % kSide != 0 || count == 0 || count > kMaxPresses ||
      header.bits != 16 || !header.grey) {
    throw std::runtime_error(
        file + " holds no presses of an object, which are 96 pixels wide and 16-bit grey");
  }
  const image::Grey16 image = image::decode_png_grey16(bytes, file);
  std::vector<TouchMap> presses(count);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const std::size_t size = presses[0].mm.size();
    presses[i / size].mm[i % size] = 1e-3F * static_cast<float>(image.pixels[i] - kZero);
  }
  return presses;
}

}  // namespace

std::filesystem::path file_of(const std::filesystem::path& folder, const std::string& name) {
  return folder / (name + ".png");
}

double distance(const std::vector<float>& a, const std::vector<float>& b) {
  return 1 - std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

double nearest(const TaughtObject& object, const std::vector<float>& features,
               std::size_t without) {
  double least = 2;
  for (std::size_t i = 0; i < object.features.size(); ++i) {
    if (i != without) least = std::min(least, distance(object.features[i], features));
  }
  return least;
}

TaughtObject teach(Network& network, std::string name, std::span<const TouchMap> presses) {
  TaughtObject object{std::move(name), {}, 0};
  object.features.reserve(presses.size());
  for (const TouchMap& press : presses) object.features.push_back(network.run(press).features);
  // Half more than the second largest: ten presses do not show an object's every side, and one odd
  // press must not make the object everything. Nor must two: one of twenty simulated objects would
  // have a radius above 0.15.
  std::vector<double> apart;
  apart.reserve(object.features.size());
  for (std::size_t i = 0; i < object.features.size(); ++i) {
    apart.push_back(nearest(object, object.features[i], i));
  }
  std::ranges::sort(apart, std::greater());
  constexpr double kMinRadius = 0.01;
  constexpr double kMaxRadius = 0.15;
  object.radius = std::clamp(apart.size() > 1 ? 1.5 * apart[1] : 0.0, kMinRadius, kMaxRadius);
  return object;
}

void check_name(const std::string& name) {
  constexpr std::size_t kMaxLength = 60;
  const auto allowed = [](unsigned char c) {
    return std::isalnum(c) != 0 || c >= 0x80 ||
           std::string_view(" ._-").find(static_cast<char>(c)) != std::string_view::npos;
  };
  if (name.empty() || name.size() > kMaxLength || !std::ranges::all_of(name, allowed) ||
      !base::is_utf8(name) ||
      std::string_view(" ._-").find(name.front()) != std::string_view::npos) {
    throw std::runtime_error(fmt::format(
        "\"{}\" is no name of an object: use 1 to {} letters, digits, spaces, and . _ - "
        "after the first",
        base::as_utf8(name), kMaxLength));
  }
}

std::vector<std::string> taught_names(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  if (!std::filesystem::exists(folder)) return names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::filesystem::path& file = entry.path();
    if (file.extension() != ".png" || file.filename().string().starts_with('.')) continue;
    names.push_back(file.stem().string());
  }
  std::ranges::sort(names);
  return names;
}

std::vector<TouchMap> read_presses(const std::filesystem::path& folder, const std::string& name) {
  const auto file = file_of(folder, name);
  if (!base::is_utf8(name)) {  // clients could not read a message with it
    throw std::runtime_error(
        fmt::format("{} has a name that is not UTF-8: rename it", base::as_utf8(file.string())));
  }
  const auto damaged = [&name](const std::string& why) {
    return std::runtime_error(fmt::format("{}: forget {}, or teach it again", why, name));
  };
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    throw damaged(file.string() + " is not a file");
  }
  const std::string bytes = base::read_file(file);  // what cannot be read may be whole
  try {
    return decode_presses(bytes, file.string());
  } catch (const std::exception& e) {
    throw damaged(e.what());
  }
}

void prepare_to_write(const std::filesystem::path& folder, const std::string& name) {
  check_name(name);
  std::filesystem::create_directories(folder);
  if (::access(folder.c_str(), W_OK) != 0) {
    throw std::runtime_error(
        fmt::format("cannot write into {}: give it to this user, or name "
                    "another folder",
                    folder.string()));
  }
  const auto file = file_of(folder, name);
  if (std::filesystem::is_directory(file)) {
    throw std::runtime_error(
        fmt::format("{} is a folder: remove it, or choose another name", file.string()));
  }
}

void write_presses(const std::filesystem::path& folder, const std::string& name,
                   std::span<const TouchMap> presses) {
  check_name(name);
  image::Grey16 image{TouchMap::kSide, TouchMap::kSide * static_cast<int>(presses.size()), {}};
  for (const TouchMap& press : presses) {
    for (const float mm : press.mm) {
      image.pixels.push_back(static_cast<std::uint16_t>(kZero + std::lround(1000 * mm)));
    }
  }
  std::filesystem::create_directories(folder);
  base::write_file_atomically(file_of(folder, name), image::encode_png(image));
}

TaughtFolder load_taught(Network& network, const std::filesystem::path& folder) {
  TaughtFolder taught;
  for (const std::string& name : taught_names(folder)) {
    try {
      taught.objects.push_back(teach(network, name, read_presses(folder, name)));
    } catch (const std::runtime_error& e) {
      taught.damaged.emplace_back(e.what());
    }
  }
  return taught;
}

}  // namespace dtact::perceive
