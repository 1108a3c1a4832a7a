#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>

#include "daemon/calibration/array_text.hpp"
#include "daemon/calibration/force_table.hpp"
#include "daemon/calibration/gain_table.hpp"
#include "daemon/calibration/layer_table.hpp"
#include "daemon/calibration/lens_file.hpp"
#include "daemon/calibration/list_tables.hpp"
#include "daemon/calibration/map_table.hpp"
#include "daemon/calibration/sensor_file.hpp"
#include "daemon/calibration/sha256.hpp"
#include "daemon/calibration/surface_table.hpp"
#include "daemon/calibration/text.hpp"
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
      "smoothing_px = {}  # standard deviation of the Gaussian on the difference\n\n",
      kFormatVersion, tomlfile::quoted(model.method == recon::Method::list ? "list" : "published"),
      tomlfile::quoted(calibration.origin.created), model.mm_per_px, model.smoothing_px);
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
  t += fmt::format("[surface]  # of the untouched gel; empty: a plane\n{}\n",
                   format_surface(model.surface));
  t += format_gain(model.gain);
  if (calibration.layer) t += format_layer(*calibration.layer);
  t += format_lists(model);
  return files;
}

}  // namespace dtact::calibration
