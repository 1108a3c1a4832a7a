#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "clients/calibrate/offline/drawing.hpp"
#include "clients/calibrate/offline/images.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/real/folder_evaluation.hpp"

namespace dtact::ctl {
namespace {

const cv::Scalar kFound(230, 60, 30);
const cv::Scalar kIdeal(30, 140, 250);

void cross(Picture& picture, recon::Point at, int arm, const cv::Scalar& colour) {
  cv::drawMarker(picture, cv::Point2d(at.x, at.y), colour, cv::MARKER_CROSS, 2 * arm + 1);
}

/// Darkening as grey: black least, white most, without two parts in a thousand at either end.
Picture grey_of(int width, int height, const std::vector<float>& levels) {
  std::vector<float> sorted;
  std::ranges::copy_if(levels, std::back_inserter(sorted), [](float v) { return !std::isnan(v); });
  std::ranges::sort(sorted);
  const std::size_t cut = sorted.size() / 500;
  const float low = sorted.empty() ? 0 : sorted[cut];
  const float high = sorted.empty() ? 1 : sorted[sorted.size() - 1 - cut];
  Picture picture(height, width, cv::Vec3b(255, 255, 255));
  for (int y = 0, i = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++i) {
      const float level = levels[static_cast<std::size_t>(i)];
      if (std::isnan(level)) continue;
      const auto grey = static_cast<std::uint8_t>(
          std::lround(230 * std::clamp((level - low) / std::max(high - low, 1e-3F), 0.F, 1.F)));
      picture(y, x) = {grey, grey, grey};
    }
  }
  return picture;
}

/// The camera's view of the board with the pins found. Twenty times enlarged: the distance of each
/// from the place that the lens through all others expects.
std::string pins_png(const FolderEvaluation& e, const PinPress& pins) {
  constexpr double kLonger = 20;
  const cv::Mat1f levels(mean_levels(e.board_reference) - mean_levels(e.board));
  Picture picture = grey_of(levels.cols, levels.rows, {levels.begin(), levels.end()});
  for (std::size_t i = 0; i < pins.marks.size(); ++i) {
    const recon::Point px = pins.marks[i].px;
    const recon::Point residual = pins.lens.left_out[i];
    const double scale = kLonger / recon::central_mm_per_px(pins.lens.lens);
    cross(picture, px, 5, kFound);
    cv::line(picture, cv::Point2d(px.x, px.y),
             cv::Point2d(px.x + scale * residual.x, px.y + scale * residual.y), kIdeal);
  }
  return image::encode_png(to_image(picture));
}

/// The board as the lens rectifies it, with the ideal grid.
std::string grid_png(const FolderEvaluation& e, const PinPress& pins) {
  const cv::Mat1f levels(mean_levels(e.board_reference) - mean_levels(e.board));
  const recon::Lens& lens = pins.lens.lens;
  const recon::MapPlace place{0, 0, levels.cols, levels.rows, recon::central_mm_per_px(lens)};
  std::vector<std::uint8_t> outside;
  const recon::RectifyTable table = make_lens_table(lens, levels.cols, levels.rows, place, outside);
  std::vector<float> rectified;
  for (std::size_t i = 0; i < outside.size(); ++i) {
    const recon::RectifyTable::Entry& at = table.entries[i];
    rectified.push_back(outside[i] != 0
                            ? std::numeric_limits<float>::quiet_NaN()
                            : levels(at.y + (at.fy + 64) / 128, at.x + (at.fx + 64) / 128));
  }
  Picture picture = grey_of(place.width, place.height, rectified);
  for (const Mark& mark : pins.marks) {
    cross(picture, map_pixel(lens, place, mark.mm), 7, kIdeal);
  }
  return image::encode_png(to_image(picture));
}

std::string depth_png(const recon::Model& model, const ImageSet& reference, const ImageSet& press) {
  std::vector<float> mm =
      calibration::mean_depth_um(model, reference.mean_q8().pixels, press.frames());
  for (float& value : mm) value *= 0.001F;
  return encode_legend_png({model.rectify.width, model.rectify.height, model.mm_per_px, mm});
}

struct Figure {
  const char* file;
  const char* caption;
};
constexpr std::array<Figure, 4> kFigures{{
    {"pins.png",
     "The camera's view of the board: darkening, the pins found (red) and, twenty times as long, "
     "how "
     "far each lies from where the lens through all the others expects it (blue)."},
    {"grid.png",
     "The board rectified, with the ideal grid (blue). White: the camera does not see it."},
    {"ball.png", "Depth of the ball. Grey: untrusted."},
    {"board.png", "Depth of the board. Grey: untrusted."},
}};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

}  // namespace

void write_page(const FolderEvaluation& e, const std::string& name,
                const std::filesystem::path& folder) {
  base::FolderFiles files;
  if (e.pins) {
    files.emplace_back("pins.png", pins_png(e, *e.pins));
    files.emplace_back("grid.png", grid_png(e, *e.pins));
  }
  if (e.calibration) {
    const recon::Model& model = *e.calibration->model;
    if (e.ball) files.emplace_back("ball.png", depth_png(model, e.ball_reference, e.ball_images));
    if (e.pin_depths) files.emplace_back("board.png", depth_png(model, e.board_reference, e.board));
  }
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>\n"
      "<style>body{{font-family:sans-serif;max-width:60em;margin:2em auto;padding:0 1em}}"
      "img{{max-width:100%}}figure{{margin:2em 0}}</style></head>\n<body><h1>{0}</h1>\n<ul>\n",
      escaped(name));
  for (const std::string& text : lines_of(e)) html += fmt::format("<li>{}</li>\n", escaped(text));
  html += "</ul>\n";
  std::vector<std::string> known{"index.html"};
  for (const Figure& figure : kFigures) {
    known.emplace_back(figure.file);
    if (std::ranges::none_of(files, [&](const auto& f) { return f.first == figure.file; }))
      continue;
    html += fmt::format("<figure><img src=\"{}\" alt=\"\"><figcaption>{}</figcaption></figure>\n",
                        figure.file, figure.caption);
  }
  files.emplace_back("index.html", html + "</body></html>\n");
  base::write_folder_atomically(folder, files, known, "an evaluation's page");
}

}  // namespace dtact::ctl
