#include "daemon/pipeline/reference/reference_store.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "hal/base/atomic_file.hpp"
#include "hal/files/key_reader.hpp"
#include "hal/files/png.hpp"

namespace dtact::pipeline {
namespace {

constexpr int kVersion = 1;
constexpr const char* kFix = "delete it, a new one is kept as soon as there is no contact";

/// FNV-1a, 64 bits: enough to notice files that do not belong together.
std::int64_t checksum(std::string_view bytes) {
  std::uint64_t hash = 14695981039346656037U;
  for (const char c : bytes) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211U;
  }
  return static_cast<std::int64_t>(hash & INT64_MAX);
}

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& why) {
  throw std::runtime_error(fmt::format("{}: {}; {}", file.string(), why, kFix));
}

hal::Light light_of(const toml::table& table, const std::filesystem::path& file) {
  hal::Light light;
  const auto brightness = table["brightness"].value<std::int64_t>();
  const toml::array* leds = table["leds"].as_array();
  if (!brightness || *brightness < 0 || *brightness > 255 || leds == nullptr ||
      leds->size() != 3 * light.leds.size()) {
    refuse(file, "\"brightness\" must be 0 to 255 and \"leds\" 24 numbers");
  }
  light.brightness = static_cast<std::uint8_t>(*brightness);
  light.gamma = table["gamma"].value_or(light.gamma);
  const auto channel = [&](std::size_t i) {
    const std::int64_t value = leds->get(i)->value<std::int64_t>().value_or(-1);
    if (value < 0 || value > 255) refuse(file, "\"leds\" must be numbers from 0 to 255");
    return static_cast<std::uint8_t>(value);
  };
  for (std::size_t i = 0; i < light.leds.size(); ++i) {
    light.leds[i] = {channel(3 * i), channel(3 * i + 1), channel(3 * i + 2)};
  }
  return light;
}

}  // namespace

void save_reference(const StoredReference& reference, const calibration::Calibration& calibration,
                    const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  const std::string png =
      image::encode_png(image::Grey16{reference.width, reference.height, reference.image_q8});
  toml::array leds;
  for (const hal::Rgb& led : reference.light.leds) {
    leds.insert(leds.end(), {std::int64_t{led.r}, std::int64_t{led.g}, std::int64_t{led.b}});
  }
  const toml::table table{{"version", kVersion},
                          {"calibration", calibration.name},
                          {"created", calibration.origin.created},
                          {"brightness", std::int64_t{reference.light.brightness}},
                          {"gamma", reference.light.gamma},
                          {"leds", std::move(leds)},
                          {"image_checksum", checksum(png)}};
  std::ostringstream text;
  text << "# The last good reference: see reference.png (16-bit grey, 256 = one grey level).\n"
       << table << '\n';
  base::write_file_atomically(folder / "reference.png", png);
  base::write_file_atomically(folder / "reference.toml", text.str());
}

std::optional<StoredReference> load_reference(const calibration::Calibration& calibration,
                                              int width, int height,
                                              const std::filesystem::path& folder) {
  const auto toml_file = folder / "reference.toml";
  const auto png_file = folder / "reference.png";
  if (!std::filesystem::exists(toml_file) || !std::filesystem::exists(png_file)) return {};
  toml::table table;
  try {
    table = tomlfile::parse(base::read_file(toml_file), toml_file.string());
  } catch (const std::runtime_error& e) {
    throw std::runtime_error(fmt::format("{}; {}", e.what(), kFix));
  }
  if (table["version"].value<std::int64_t>() != kVersion) refuse(toml_file, "unknown version");
  if (table["calibration"].value<std::string>() != calibration.name ||
      table["created"].value<std::string>() != calibration.origin.created) {
    return {};
  }
  StoredReference stored;
  stored.light = light_of(table, toml_file);
  const std::string png = base::read_file(png_file);
  if (table["image_checksum"].value<std::int64_t>() != checksum(png)) {
    refuse(png_file, "belongs to another reference.toml");
  }
  const image::PngHeader header = image::png_header(png, png_file.string());
  if (header.width != width || header.height != height) return {};
  stored.width = width;
  stored.height = height;
  stored.image_q8 = image::decode_png_grey16(png, png_file.string()).pixels;
  return stored;
}

}  // namespace dtact::pipeline
