#include "daemon/calibration/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>

#include "daemon/calibration/calibration.hpp"
#include "daemon/calibration/lut_tables.hpp"
#include "daemon/calibration/sensor_files.hpp"
#include "daemon/calibration/tables.hpp"
#include "daemon/recon/rectify.hpp"
#include "hal/files/key_reader.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {
namespace {

bool same(const recon::RectifyTable& a, const recon::RectifyTable& b) {
  return std::ranges::equal(a.entries, b.entries, [](const auto& p, const auto& q) {
    return p.x == q.x && p.y == q.y && p.fx == q.fx && p.fy == q.fy;
  });
}

/// The mask as runs: first pixel, number of pixels, first, number, ...
std::vector<std::int64_t> runs_of(const std::vector<std::uint8_t>& mask) {
  std::vector<std::int64_t> runs;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == 0) continue;
    if (i == 0 || mask[i - 1] == 0) {
      runs.push_back(static_cast<std::int64_t>(i));
      runs.push_back(0);
    }
    ++runs.back();
  }
  return runs;
}

constexpr std::int64_t kMaxFramePixels = std::int64_t{1} << 26U;  // 8192×8192, any camera's mode

std::vector<std::uint8_t> mask_of(tomlfile::KeyReader& reader, std::size_t pixels) {
  const auto limit = static_cast<std::int64_t>(pixels);
  const std::vector<std::int64_t> runs = reader.integers("runs", 0, limit);
  if (runs.size() % 2 != 0) reader.fail("runs", "expected pairs of first pixel and count");
  std::vector<std::uint8_t> mask(pixels);
  std::int64_t end = 0;  // of the run before: each pixel is set once, however many runs there are
  for (std::size_t i = 0; i < runs.size(); i += 2) {
    if (runs[i] < end) {
      reader.fail("runs",
                  fmt::format("pair {} begins before the end of the one before", i / 2 + 1));
    }
    if (runs[i + 1] > limit - runs[i]) {
      reader.fail("runs", fmt::format("pair {} leaves the map of {} pixels", i / 2 + 1, pixels));
    }
    std::fill_n(mask.begin() + runs[i], runs[i + 1], std::uint8_t{1});
    end = runs[i] + runs[i + 1];
  }
  return mask;
}

/// "2026-01-31T12:00:00Z".
bool is_utc_time(std::string_view text) {
  constexpr std::string_view kShape = "dddd-dd-ddTdd:dd:ddZ";
  return std::ranges::equal(text, kShape, [](char c, char shape) {
    return shape == 'd' ? c >= '0' && c <= '9' : c == shape;
  });
}

std::string sha256_key(tomlfile::KeyReader& reader) {
  std::string digest = reader.text("sha256");
  if (digest.size() != 64 || digest.find_first_not_of("0123456789abcdef") != std::string::npos) {
    reader.fail("sha256", "expected 64 lower-case hexadecimal digits");
  }
  return digest;
}

/// Keeps a small file from asking for gigabytes.
void check_area(const tomlfile::KeyReader& reader, int width, int height, std::int64_t most) {
  if (std::int64_t{width} * height <= most) return;
  reader.fail("width", fmt::format("{}x{} pixels are more than {}", width, height, most));
}

int small(tomlfile::KeyReader& reader, const char* key, int low, int high) {
  return static_cast<int>(reader.integer(key, low, high));
}

void read_reference(tomlfile::KeyReader reader, const std::string& png, const std::string& where,
                    recon::Model& model) {
  const std::string expected = sha256_key(reader);
  reader.finish();
  if (sha256_hex(png) != expected) {
    reader.fail("sha256", fmt::format("{} beside {} is another one or damaged; copy the whole "
                                      "folder again or calibrate again",
                                      kReferenceName, where));
  }
  const image::PngHeader header = image::png_header(png, kReferenceName);
  if (header.width != model.rectify.frame_width || header.height != model.rectify.frame_height) {
    reader.fail("",
                fmt::format("{} is {}x{} but frame says {}x{}", kReferenceName, header.width,
                            header.height, model.rectify.frame_width, model.rectify.frame_height));
  }
  if (header.bits != 16 || !header.grey) {
    reader.fail("",
                fmt::format("{} is not 16-bit grey; copy the whole folder again", kReferenceName));
  }
  image::Grey16 image = image::decode_png_grey16(png, kReferenceName);
  if (std::ranges::max(image.pixels) > 255 * 256) {
    reader.fail(
        "", fmt::format("{} has values above 65280 (grey level 255 times 256)", kReferenceName));
  }
  model.reference_q8 = std::move(image.pixels);
}

}  // namespace

Files format(const Calibration& calibration) {
  const recon::Model& model = *calibration.model;
  const recon::RectifyTable& map = model.rectify;
  std::vector<std::uint8_t> outside;
  if (!same(map, map_table(calibration.lens, map.frame_width, map.frame_height,
                           {calibration.crop_col, calibration.crop_row, map.width, map.height,
                            model.mm_per_px},
                           outside))) {
    throw std::invalid_argument("calibration: the rectification is not what crop and lens say");
  }
  Files files;
  files.reference_png =
      image::encode_png(image::Grey16{map.frame_width, map.frame_height, model.reference_q8});

  std::string& t = files.toml;
  t = fmt::format(
      "# A calibration of dtactd. Written by dtactctl; checksums protect what belongs together.\n"
      "version = {}\n"
      "method = {}\n"
      "created = {}  # UTC\n"
      "mm_per_px = {}  # of the depth map\n"
      "scale_from = {}\n"
      "smoothing_px = {}  # standard deviation of the Gaussian on the difference\n\n",
      kFormatVersion, tomlfile::quoted(model.method == recon::Method::lut ? "lut" : "published"),
      tomlfile::quoted(calibration.origin.created), model.mm_per_px,
      tomlfile::quoted(calibration.origin.scale_from), model.smoothing_px);
  t += fmt::format("[frame]\nwidth = {}\nheight = {}\n\n", map.frame_width, map.frame_height);
  t += fmt::format(
      "[crop]  # the depth map in the frame, or in the image that the lens rectifies\ncol = "
      "{}\nrow = {}\nwidth = {}\n"
      "height = {}\n\n",
      calibration.crop_col, calibration.crop_row, map.width, map.height);
  t += fmt::format("[reference]  # {}: 16-bit grey, grey level times 256\nsha256 = {}\n\n",
                   kReferenceName, tomlfile::quoted(sha256_hex(files.reference_png)));
  t += format_camera_and_light(calibration.origin);
  for (const Origin::Source& source : calibration.origin.sources) {
    t += fmt::format("[[source]]\nname = {}\nsha256 = {}\n\n", tomlfile::quoted(source.name),
                     tomlfile::quoted(source.sha256));
  }
  if (std::ranges::any_of(model.untrusted, [](std::uint8_t mark) { return mark != 0; })) {
    t += fmt::format(
        "[untrusted]  # pixels of the map never to believe: first, count, ...\n"
        "runs = {}\n\n",
        array_text(runs_of(model.untrusted)));
  }
  if (model.force) t += format_force(*model.force);
  t += fmt::format(
      "[lens]  # where the surface appears in the frame; empty: the frame as it is\n{}\n",
      calibration.lens ? format_lens(*calibration.lens) : "");
  t += format_view(calibration.view);
  t += fmt::format("[surface]  # of the undeformed gel; empty: a plane\n{}\n",
                   format_surface(model.surface));
  t += format_gain(model.gain);
  if (calibration.gel) t += format_gel(*calibration.gel);
  t += format_luts(model);
  return files;
}

Calibration parse(const std::string& toml, const std::string& reference_png,
                  const std::string& where, const std::optional<FrameSize>& camera) {
  const toml::table document = tomlfile::parse(toml, where);
  tomlfile::KeyReader top(document, where);
  // Before anything else: another version's keys mean something else.
  (void)top.integer("version", kFormatVersion, kFormatVersion);

  Calibration calibration;
  auto model = std::make_shared<recon::Model>();
  const std::string method = top.text("method");
  if (method != "lut" && method != "published") {
    top.fail("method", "\"" + method + "\" is not allowed; expected \"lut\" or \"published\"");
  }
  model->method = method == "lut" ? recon::Method::lut : recon::Method::published;
  calibration.origin.created = top.text("created");
  if (!calibration.origin.created.empty() && !is_utc_time(calibration.origin.created)) {
    top.fail("created", "expected a time as \"2026-01-31T12:00:00Z\"");
  }
  model->mm_per_px = top.number("mm_per_px", 0.0001, 10);
  if (top.has("scale_from")) calibration.origin.scale_from = top.text("scale_from");
  model->smoothing_px = top.number("smoothing_px", 0, 10);

  tomlfile::KeyReader frame = top.table("frame");
  const int frame_width = small(frame, "width", 2, kMaxPixels);
  const int frame_height = small(frame, "height", 2, kMaxPixels);
  frame.finish();
  if (camera && !camera->gives(frame_width, frame_height)) {
    top.fail("frame",
             fmt::format("is for frames of {}x{} pixels, the camera delivers {}: set camera.width, "
                         "camera.height and camera.decode_scale to the calibration's, or calibrate "
                         "in this mode",
                         frame_width, frame_height, camera->text()));
  }
  check_area(frame, frame_width, frame_height, kMaxFramePixels);
  tomlfile::KeyReader crop = top.table("crop");
  calibration.crop_col = small(crop, "col", 0, frame_width - 1);
  calibration.crop_row = small(crop, "row", 0, frame_height - 1);
  const int width = small(crop, "width", 1, frame_width - calibration.crop_col);
  const int height = small(crop, "height", 1, frame_height - calibration.crop_row);
  crop.finish();
  check_area(crop, width, height, recon::kMaxMapPixels);
  if (top.has("lens")) {
    calibration.lens = read_lens(top.table("lens"), frame_width, frame_height);
  }
  std::vector<std::uint8_t> outside;
  model->rectify = map_table(
      calibration.lens, frame_width, frame_height,
      {calibration.crop_col, calibration.crop_row, width, height, model->mm_per_px}, outside);

  read_luts(top, *model);
  if (top.has("gel")) calibration.gel = read_gel(top.table("gel"));
  if (top.has("gain")) model->gain = read_gain(top.table("gain"));
  read_camera_and_light(top, calibration.origin);
  for (tomlfile::KeyReader& source : top.tables("source")) {
    calibration.origin.sources.push_back({source.text("name"), sha256_key(source)});
    source.finish();
  }
  if (top.has("untrusted")) {
    tomlfile::KeyReader untrusted = top.table("untrusted");
    model->untrusted = mask_of(untrusted, model->rectify.entries.size());
    untrusted.finish();
  }
  if (top.has("force")) model->force = read_force(top.table("force"));
  add_untrusted(*model, outside);
  if (top.has("surface")) model->surface = read_surface(top.table("surface"));
  if (top.has("viewpoint")) {
    const tomlfile::KeyReader view = top.table("viewpoint");
    calibration.view = read_view(view);
    if (calibration.view.per_mm == 0) {
      view.fail("per_mm", "must be above 0; without the table the height is unknown");
    }
    // Behind a curved surface [surface] says where the camera stands.
    if (model->surface.kind == recon::Surface::Kind::plane) {
      model->surface.view = {calibration.view.foot_mm, calibration.view.per_mm};
    }
  }
  read_reference(top.table("reference"), reference_png, where, *model);
  top.finish();
  calibration.model = std::move(model);
  return calibration;
}

}  // namespace dtact::calibration
